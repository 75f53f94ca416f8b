"""How much two arms depend on each other, measured from the physics of an episode.

The PerAct2 paper sorts its tasks by hand into temporally, spatially and physically coupled, symmetric and
synchronous ones. A `CouplingMeter` watches an episode and reduces it to numbers beside that table.

Transmitted force
    Let F_left and F_right be the net contact forces of the two hands on an object that both touch. Along the
    direction in which the two differ, and only there, they can be written as

        F_left = a u + w,   F_right = -b u + w,   u a unit vector,

    with one and the same w: the load that both carry alike. Where a and b are both positive, the hands squeeze,
    pull or shear the object against each other, and the smaller of the two is what one arm passes to the other
    through it; the rest moves the object or goes into the table. Otherwise nothing is passed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.contacts import ContactQueries
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import TICK_S

MOVING_M_S = 0.02
"""Speed above which a hand counts as moving."""
NONE = -1
"""Neither a hand, nor an object."""


@dataclass(frozen=True)
class Coupling:
    """The coupling of the two arms in one episode.

    Attributes:
        shared_object_s: seconds in which both hands touched the same movable object (all links of an articulated
            object are one; a door or a drawer of standing furniture is an object of its own).
        transmitted_force_mean_n: N, over that time, that one arm passed to the other through the object.
        transmitted_force_peak_n: N, the largest such force.
        both_moving_share: time in which both hands moved over time in which at least one did.
        speed_correlation: Pearson correlation of the hands' speeds, -1 to 1; 0 if one never changed its speed.
        mirror_similarity: of the left hand's velocities l and the right one's, mirrored in the plane half-way
            between the hands, r: 2 sum(l r) / sum(l l + r r) over the episode. 1 for mirror images, -1 where one
            hand follows the other, 0 for one hand alone.
    """

    shared_object_s: float
    transmitted_force_mean_n: float
    transmitted_force_peak_n: float
    both_moving_share: float
    speed_correlation: float
    mirror_similarity: float


class _Touch(NamedTuple):
    """A contact of a hand with a movable object.

    Attributes:
        contact: its index.
        hand: 0 left, 1 right.
        object: kinematic tree.
        sign: 1 if the object's geom is the contact's second one, on which MuJoCo's contact force acts, else -1.
    """

    contact: int
    hand: int
    object: int
    sign: int


class CouplingMeter:
    """Measures one episode of a scene; it only reads, so the episode goes on bit for bit as without it.

    Args:
        scene: the scene, at any time between its compilation and the first observation.
    """

    def __init__(self, scene: Scene):
        model, pair = scene.model, scene.arm_pair
        contacts = ContactQueries(model, scene.data)
        hand_of_geom = np.full(model.ngeom, NONE)
        object_of_geom = model.body_treeid[model.geom_bodyid].copy()  # of what cannot move it is NONE already
        for arm in ARMS:
            hand_of_geom[contacts.geoms(pair.hand_body(arm))] = arm.ordinal
            object_of_geom[contacts.geoms(pair.base_body(arm))] = NONE
        self._scene = scene
        self._tcp_sites = [model.site(pair.tcp_site(arm)).id for arm in ARMS]
        # Of a handful of contacts, plain lists are several times faster than arrays.
        self._hand_of_geom: list[int] = hand_of_geom.tolist()
        self._object_of_geom: list[int] = object_of_geom.tolist()
        self._solved = mujoco.MjData(model)
        self._tips_m: list[NDArray[np.float64]] = []
        self._transmitted_n: list[float] = []

    def observe(self) -> None:
        """Take the present moment into account; call it at the start of the episode and after every tick."""
        self._tips_m.append(self._scene.data.site_xpos[self._tcp_sites])
        touches = self._touches()
        touched = [{touch.object for touch in touches if touch.hand == arm.ordinal} for arm in ARMS]
        shared = set.intersection(*touched)
        if shared:
            self._solve_forces()
            self._transmitted_n.append(sum(self._transmitted_force(touches, object_) for object_ in shared))

    def result(self) -> Coupling:
        """The coupling over all observations so far."""
        tips_m = np.reshape(self._tips_m, (-1, len(ARMS), 3))
        velocities = np.diff(tips_m, axis=0) / TICK_S
        speeds = np.linalg.norm(velocities, axis=-1)
        moving = speeds > MOVING_M_S
        return Coupling(
            shared_object_s=len(self._transmitted_n) * TICK_S,
            transmitted_force_mean_n=float(np.mean(self._transmitted_n or 0)),
            transmitted_force_peak_n=max(self._transmitted_n, default=0.0),
            both_moving_share=_ratio(float(moving.all(axis=1).sum()), float(moving.any(axis=1).sum())),
            speed_correlation=_correlation(speeds),
            mirror_similarity=_mirror_similarity(tips_m[:-1], velocities),
        )

    def _touches(self) -> list[_Touch]:
        hand_of, object_of = self._hand_of_geom, self._object_of_geom
        touches = []
        for contact, (first, second) in enumerate(self._scene.data.contact.geom.reshape(-1, 2).tolist()):
            if hand_of[first] != NONE and object_of[second] != NONE:
                touches.append(_Touch(contact, hand_of[first], object_of[second], 1))
            elif hand_of[second] != NONE and object_of[first] != NONE:
                touches.append(_Touch(contact, hand_of[second], object_of[first], -1))
        return touches

    def _solve_forces(self) -> None:
        """Solve for the contact forces of the present moment, in a copy.

        After a tick the contacts are those of the new positions, but their forces are not known yet; solving for
        them in the scene itself would change the warm start of its next step.
        """
        mujoco.mj_copyData(self._solved, self._scene.model, self._scene.data)
        mujoco.mj_forwardSkip(self._scene.model, self._solved, mujoco.mjtStage.mjSTAGE_VEL, 1)

    def _transmitted_force(self, touches: list[_Touch], object_: int) -> float:
        """N, that the hands pass to each other through one object."""
        touches = [touch for touch in touches if touch.object == object_]
        contacts, hands, _, signs = np.array(touches).T
        wrenches = np.empty((len(touches), 6))  # in the contacts' frames: force, torque
        for touch, wrench in zip(touches, wrenches, strict=True):
            mujoco.mj_contactForce(self._scene.model, self._solved, touch.contact, wrench)
        frames = self._solved.contact.frame.reshape(-1, 3, 3)[contacts]  # world axes in rows
        forces_n = signs[:, None] * np.einsum("ti,tij->tj", wrenches[:, :3], frames)
        return transmitted_force(*(forces_n[hands == arm.ordinal].sum(axis=0) for arm in ARMS))


def transmitted_force(left_n: NDArray[np.float64], right_n: NDArray[np.float64]) -> float:
    """Force in N that two hands pass to each other through an object; see the module's text.

    Args:
        left_n: (3,) net force of the left hand on the object.
        right_n: (3,) net force of the right hand on it, in the same axes.
    """
    difference = left_n - right_n
    length = float(np.linalg.norm(difference))
    if length == 0:
        return 0.0
    return max(0.0, min(float(left_n @ difference), float(-right_n @ difference)) / length)


def _mirror_similarity(tips_m: NDArray[np.float64], velocities: NDArray[np.float64]) -> float:
    """Of positions and velocities (n, 2, 3)."""
    between = tips_m[:, 1] - tips_m[:, 0]
    normal = between / np.linalg.norm(between, axis=1, keepdims=True)
    left, right = velocities[:, 0], velocities[:, 1]
    mirrored = right - 2 * np.sum(right * normal, axis=1, keepdims=True) * normal
    return _ratio(2 * float(np.sum(left * mirrored)), float(np.sum(left**2 + right**2)))


def _correlation(speeds: NDArray[np.float64]) -> float:
    """Of two columns (n, 2)."""
    if not len(speeds):
        return 0.0
    left, right = (speeds - speeds.mean(axis=0)).T
    return _ratio(float(left @ right), float(np.linalg.norm(left) * np.linalg.norm(right)))


def _ratio(part: float, whole: float) -> float:
    """0 of nothing."""
    return part / whole if whole > 0 else 0.0


def mean_coupling(couplings: Sequence[Coupling]) -> Coupling:
    """The average of several episodes, field by field."""
    return Coupling(*np.mean([astuple(coupling) for coupling in couplings], axis=0).tolist())
