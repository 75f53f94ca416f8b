"""Conditions of success: named predicates of a scene.

A task succeeds when all its conditions hold for half a second; their names are what `info["conditions"]`,
failure reports and tests print. All positions are in metres, world frame.

Most conditions are about the present state. `Once` and `Always` are about all ticks so far: they are evaluated after every
control tick, and the episode remembers the results.
"""

import functools
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import ClassVar

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_env_bimanual.world.scene_view import SceneView


@dataclass(frozen=True)
class Condition(ABC):
    """A predicate of a scene; its name is unique within a task."""

    @functools.cached_property  # read at every tick
    def name(self) -> str:
        """The class and the fields that its `repr` shows, e.g. `above(ball, 0.95)`."""
        shown = (_shown(getattr(self, field.name)) for field in fields(self) if field.repr)
        words = re.sub("(?<!^)(?=[A-Z])", "_", type(self).__name__).lower()
        return f"{words}({', '.join(shown)})"

    @abstractmethod
    def __call__(self, view: SceneView) -> bool:
        """Whether it holds now."""


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(_shown, value))
    return f"{value:.2f}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class OnTheWay(Condition):
    """A condition about all ticks so far, made of conditions on single ticks; calling it evaluates the present tick only."""

    parts: tuple[Condition, ...]
    word: ClassVar[str]  # joins the names of the parts

    @functools.cached_property
    def name(self) -> str:
        """The class and its parts, e.g. `once(held(item, left) and held(item, right))`."""
        parts = f" {self.word} ".join(part.name for part in self.parts)
        return f"{type(self).__name__.lower()}({parts})"

    @abstractmethod
    def after(self, so_far: bool | None, view: SceneView) -> bool:
        """Whether it is met now; `so_far` says whether it was met a tick ago, None at the start of an episode."""


def history_conditions(
    conditions: Iterable[Condition], view: SceneView, so_far: Mapping[str, bool]
) -> dict[str, bool]:
    """Name of each condition on the way, and whether it is met after one more tick."""
    return {
        condition.name: condition.after(so_far.get(condition.name), view)
        for condition in conditions
        if isinstance(condition, OnTheWay)
    }


def check(
    conditions: Iterable[Condition], view: SceneView, known: Mapping[str, bool], until_unmet: bool = False
) -> dict[str, bool]:
    """Each condition's name and whether it is met now; known ones are not evaluated again.

    With `until_unmet` only up to the first that is not met, which is enough for a verdict.
    """
    met: dict[str, bool] = {}
    for condition in conditions:
        name = condition.name
        met[name] = known[name] if name in known else condition(view)
        if until_unmet and not met[name]:
            break
    return met


@dataclass(frozen=True)
class Above(Condition):
    """The prop's origin is at least this high."""

    prop: str
    height_m: float

    def __call__(self, view: SceneView) -> bool:
        return bool(view.pose(self.prop).position[2] >= self.height_m)


@dataclass(frozen=True)
class WhollyAbove(Condition):
    """Every point of the prop, or of the boxes around its geoms, is at least this high."""

    prop: str
    height_m: float

    def __call__(self, view: SceneView) -> bool:
        geoms = view.geoms(self.prop)
        centres, half_sizes = np.split(view.model.geom_aabb[geoms], 2, axis=1)
        vertical = view.data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
        middles = view.data.geom_xpos[geoms, 2] + (vertical * centres).sum(axis=1)
        return bool((middles - (np.abs(vertical) * half_sizes).sum(axis=1)).min() >= self.height_m)


@dataclass(frozen=True)
class CentredOn(Condition):
    """The prop's origin lies over a square around the target's origin, whose sides are parallel to the target's axes.

    Attributes:
        prop: body whose origin counts.
        target: body around whose origin the square lies.
        tolerance_m: half side of the square.
        varied_m: half side in the setting `varied`; None if it is the same.
    """

    prop: str
    target: str
    tolerance_m: float = field(repr=False)
    varied_m: float | None = field(default=None, repr=False)

    def __call__(self, view: SceneView) -> bool:
        offset = view.pose(self.target).inverse().apply(view.pose(self.prop).position)
        is_other = view.is_varied and self.varied_m is not None
        return bool(np.abs(offset[:2]).max() <= (self.varied_m if is_other else self.tolerance_m))


@dataclass(frozen=True)
class Inside(Condition):
    """The prop's origin lies in a box that is fixed to a container and moves with it.

    Attributes:
        prop: body whose origin counts.
        container: body in whose frame the box is fixed.
        lower_m: corner of the box, (3,); an enlarged container enlarges the box.
        upper_m: the opposite corner, (3,).
    """

    prop: str
    container: str
    lower_m: tuple[float, float, float] = field(repr=False)
    upper_m: tuple[float, float, float] = field(repr=False)

    def __call__(self, view: SceneView) -> bool:
        position = view.pose(self.container).inverse().apply(view.pose(self.prop).position)
        position /= view.scales.get(self.container, 1.0)
        return bool(np.all(position >= self.lower_m) and np.all(position <= self.upper_m))


@dataclass(frozen=True)
class NoneInside(Condition):
    """No prop's origin lies in a box that is fixed to a container; see `Inside`.

    Attributes:
        props: bodies whose origins count.
        container: body in whose frame the box stands.
        lower_m: corner of the box, (3,).
        upper_m: the opposite corner, (3,).
    """

    props: tuple[str, ...]
    container: str
    lower_m: tuple[float, float, float] = field(repr=False)
    upper_m: tuple[float, float, float] = field(repr=False)

    def __call__(self, view: SceneView) -> bool:
        return not any(Inside(prop, self.container, self.lower_m, self.upper_m)(view) for prop in self.props)


@dataclass(frozen=True)
class AtRest(Condition):
    """The prop's origin hardly moves."""

    prop: str
    speed_m_s: float = field(default=0.02, repr=False)

    def __call__(self, view: SceneView) -> bool:
        return bool(view.speed(self.prop) <= self.speed_m_s)


@dataclass(frozen=True)
class Touched(Condition):
    """Palm or fingers of the arm are in contact with the prop."""

    prop: str
    by: Arm

    def __call__(self, view: SceneView) -> bool:
        return view.touching(self.by, self.prop)


@dataclass(frozen=True)
class Untouched(Condition):
    """No part of the arm is in contact with the prop, so it neither holds nor supports it."""

    prop: str
    by: Arm

    def __call__(self, view: SceneView) -> bool:
        return not view.arm_touches(self.by, self.prop)


@dataclass(frozen=True)
class Held(Condition):
    """The arm's hand grips the prop between its fingers; see `SceneView.held`."""

    prop: str
    by: Arm

    def __call__(self, view: SceneView) -> bool:
        return view.held(self.by, self.prop)


@dataclass(frozen=True)
class Grasped(Condition):
    """One hand, whichever, grips the prop between its fingers; see `SceneView.held`."""

    prop: str

    def __call__(self, view: SceneView) -> bool:
        return any(view.held(arm, self.prop) for arm in ARMS)


@dataclass(frozen=True)
class Pressed(Condition):
    """The button's cap, a joint called `<button>_cap`, is down by at least this much."""

    button: str
    travel_m: float = field(default=0.001, repr=False)

    def __call__(self, view: SceneView) -> bool:
        return bool(view.joint_value(f"{self.button}_cap") <= -self.travel_m)


@dataclass(frozen=True)
class Near(Condition):
    """The prop's origin is within this distance, along the table, of where it was placed."""

    prop: str
    distance_m: float

    def __call__(self, view: SceneView) -> bool:
        offset_m = view.pose(self.prop).position - view.placed_m(self.prop)
        return bool(np.hypot(*offset_m[:2]) <= self.distance_m)


@dataclass(frozen=True)
class Raised(Condition):
    """The prop's origin is at least this far above where it was placed."""

    prop: str
    rise_m: float

    def __call__(self, view: SceneView) -> bool:
        return bool(view.pose(self.prop).position[2] - view.placed_m(self.prop)[2] >= self.rise_m)


@dataclass(frozen=True)
class Tipped(Condition):
    """The prop leans by at least this many degrees, and its origin is less than this far above where it was placed."""

    prop: str
    lean_deg: float
    rise_m: float

    def __call__(self, view: SceneView) -> bool:
        leans = view.pose(self.prop).rotation[2, 2] <= math.cos(math.radians(self.lean_deg))
        return bool(leans) and not Raised(self.prop, self.rise_m)(view)


@dataclass(frozen=True)
class Aligned(Condition):
    """The prop's heading, the horizontal direction of its x axis, differs from the target's by at most this many degrees."""

    prop: str
    target: str
    tolerance_deg: float

    def __call__(self, view: SceneView) -> bool:
        (x, y), (target_x, target_y) = (view.pose(body).rotation[:2, 0] for body in (self.prop, self.target))
        angle_rad = math.atan2(target_x * y - target_y * x, target_x * x + target_y * y)
        return bool(abs(angle_rad) <= np.deg2rad(self.tolerance_deg))


@dataclass(frozen=True)
class Unhandled(Condition):
    """No part of either arm is in contact with any of the props."""

    props: tuple[str, ...]

    def __call__(self, view: SceneView) -> bool:
        arms = tuple(view.arm_pair.base_body(arm) for arm in ARMS)
        return not view.contacts(arms, self.props)


@dataclass(frozen=True)
class Once(OnTheWay):
    """All the conditions named in it have held at the same tick, once or more."""

    word: ClassVar[str] = "and"

    def __call__(self, view: SceneView) -> bool:
        return all(part(view) for part in self.parts)

    def after(self, so_far: bool | None, view: SceneView) -> bool:
        return bool(so_far) or self(view)


@dataclass(frozen=True)
class Always(OnTheWay):
    """At every tick so far at least one of the conditions named in it held."""

    word: ClassVar[str] = "or"

    def __call__(self, view: SceneView) -> bool:
        return any(part(view) for part in self.parts)

    def after(self, so_far: bool | None, view: SceneView) -> bool:
        return so_far is not False and self(view)
