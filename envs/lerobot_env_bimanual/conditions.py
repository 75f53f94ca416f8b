"""Truths about a scene, as small values with a name.

A task succeeds when all its conditions hold for half a second; their names are what `info["conditions"]`,
failure reports and tests print. All positions are in metres, world frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm

if TYPE_CHECKING:
    from lerobot_env_bimanual.world.scene import Scene

REST_SPEED_M_S = 0.02


class Condition(Protocol):
    """Something that is either true or false of a scene."""

    @property
    def name(self) -> str:
        """Unique within a task, readable in a report."""
        ...

    def __call__(self, scene: Scene) -> bool:
        """Whether it holds now."""
        ...


@dataclass(frozen=True)
class Above:
    """The prop's origin is at least this high."""

    prop: str
    height_m: float

    @property
    def name(self) -> str:
        """E.g. `above(ball, 0.95)`."""
        return f"above({self.prop}, {self.height_m:.2f})"

    def __call__(self, scene: Scene) -> bool:
        """Compare the z coordinate of the prop's origin."""
        return bool(scene.pose(self.prop).position[2] >= self.height_m)


@dataclass(frozen=True)
class WhollyAbove:
    """Every point of the prop, or of the boxes around its geoms, is at least this high."""

    prop: str
    height_m: float

    @property
    def name(self) -> str:
        """E.g. `wholly_above(tray, 1.35)`."""
        return f"wholly_above({self.prop}, {self.height_m:.2f})"

    def __call__(self, scene: Scene) -> bool:
        """Compare the lowest corner."""
        geoms = scene.model.geom_bodyid == scene.model.body(self.prop).id
        centres, half_sizes = np.split(scene.model.geom_aabb[geoms], 2, axis=1)
        vertical = scene.data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
        middles = scene.data.geom_xpos[geoms, 2] + (vertical * centres).sum(axis=1)
        return bool((middles - (np.abs(vertical) * half_sizes).sum(axis=1)).min() >= self.height_m)


@dataclass(frozen=True)
class CentredOn:
    """The prop's origin lies over the square of this half side at the target's centre, in the target's axes."""

    prop: str
    target: str
    tolerance_m: float

    @property
    def name(self) -> str:
        """E.g. `centred_on(box, target)`."""
        return f"centred_on({self.prop}, {self.target})"

    def __call__(self, scene: Scene) -> bool:
        """Compare x and y of the prop's origin in the target's frame."""
        offset = scene.pose(self.target).inverse().apply(scene.pose(self.prop).position)
        return bool(np.abs(offset[:2]).max() <= self.tolerance_m)


@dataclass(frozen=True)
class Inside:
    """The prop's origin lies in a box that is fixed to a container and moves with it.

    Attributes:
        prop: body whose origin counts.
        container: body in whose frame the box stands.
        lower_m: corner of the box, (3,).
        upper_m: the opposite corner, (3,).
    """

    prop: str
    container: str
    lower_m: tuple[float, float, float]
    upper_m: tuple[float, float, float]

    @property
    def name(self) -> str:
        """E.g. `inside(item, cabinet_top)`."""
        return f"inside({self.prop}, {self.container})"

    def __call__(self, scene: Scene) -> bool:
        """Compare the prop's origin in the container's frame."""
        position = scene.pose(self.container).inverse().apply(scene.pose(self.prop).position)
        return bool(np.all(position >= self.lower_m) and np.all(position <= self.upper_m))


@dataclass(frozen=True)
class AtRest:
    """The prop's origin hardly moves."""

    prop: str
    speed_m_s: float = REST_SPEED_M_S

    @property
    def name(self) -> str:
        """E.g. `at_rest(box)`."""
        return f"at_rest({self.prop})"

    def __call__(self, scene: Scene) -> bool:
        """Compare the linear speed."""
        return bool(scene.speed(self.prop) <= self.speed_m_s)


@dataclass(frozen=True)
class Touched:
    """Palm or fingers of the arm are in contact with the prop."""

    prop: str
    by: Arm

    @property
    def name(self) -> str:
        """E.g. `touched(ball, left)`."""
        return f"touched({self.prop}, {self.by})"

    def __call__(self, scene: Scene) -> bool:
        """Look through the contacts."""
        return scene.touching(self.by, self.prop)


@dataclass(frozen=True)
class Untouched:
    """No part of the arm is in contact with the prop, so it neither holds nor supports it."""

    prop: str
    by: Arm

    @property
    def name(self) -> str:
        """E.g. `untouched(item, left)`."""
        return f"untouched({self.prop}, {self.by})"

    def __call__(self, scene: Scene) -> bool:
        """Look through the contacts."""
        return not scene.arm_touches(self.by, self.prop)


@dataclass(frozen=True)
class Held:
    """Both fingers of the arm are in contact with the prop."""

    prop: str
    by: Arm

    @property
    def name(self) -> str:
        """E.g. `held(item, right)`."""
        return f"held({self.prop}, {self.by})"

    def __call__(self, scene: Scene) -> bool:
        """Look through the contacts."""
        return scene.held(self.by, self.prop)


@dataclass(frozen=True)
class Grasped:
    """Both fingers of one hand, whichever, are in contact with the prop."""

    prop: str

    @property
    def name(self) -> str:
        """E.g. `grasped(plate)`."""
        return f"grasped({self.prop})"

    def __call__(self, scene: Scene) -> bool:
        """Look through the contacts."""
        return any(scene.held(arm, self.prop) for arm in ARMS)


@dataclass(frozen=True)
class Pressed:
    """The button's cap, a joint called `<button>_cap`, is down by at least this much."""

    button: str
    travel_m: float = 0.001

    @property
    def name(self) -> str:
        """E.g. `pressed(button)`."""
        return f"pressed({self.button})"

    def __call__(self, scene: Scene) -> bool:
        """Compare the joint with its rest at zero."""
        return bool(scene.joint_value(f"{self.button}_cap") <= -self.travel_m)
