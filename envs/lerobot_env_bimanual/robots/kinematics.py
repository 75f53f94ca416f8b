"""Kinematics of one Franka arm at its place in the world.

Seven joints reach a pose in a one-parameter family of ways. With the last angle q7 given, the rest has a closed
form (the `frankik` package): up to four solutions. Searching over q7 is therefore a complete search, without
starting values, iterations or random restarts.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import frankik
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import JOINTS_PER_ARM, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.robots.arm_pair import ArmPair

Array = NDArray[np.floating]

LIMIT_SAFETY_RAD = 0.02
"""Distance that every solution keeps from the joint limits."""
GRID_SIZE = 77
GRID_SPAN_DEG = 326.0
"""The redundancy angle q7 is searched at 77 values over its whole range (design study)."""
NEAR_GRID_SIZE = 20
NEAR_GRID_SPAN_DEG = 40.0

EXACT = 1e-6
"""Largest error of a solution's pose matrix, m and rad."""

# frankik's inverse kinematics aims the flange, its forward kinematics returns the hand's tool centre point.
_frankik: Any = frankik  # its stubs ask for literal array shapes, which NumPy's own types do not carry
_HALF = np.sqrt(0.5)
TCP_T_FLANGE = np.array(
    [[_HALF, -_HALF, 0.0, 0.0], [_HALF, _HALF, 0.0, 0.0], [0.0, 0.0, 1.0, -0.1034], [0.0, 0.0, 0.0, 1.0]]
)


@dataclass(frozen=True, eq=False)
class ArmKinematics:
    """Forward and inverse kinematics; poses are homogeneous matrices of the tool centre point in the world.

    Attributes:
        base: World pose of the arm's base.
        lower: (7,) rad, lower joint limits.
        upper: (7,) rad, upper joint limits.
    """

    base: Pose
    lower: Array
    upper: Array
    _base_matrix: Array = field(init=False)
    _to_base: Array = field(init=False)

    def __post_init__(self):
        """Keep the base's matrices, which every call needs."""
        object.__setattr__(self, "_base_matrix", self.base.matrix)
        object.__setattr__(self, "_to_base", self.base.inverse().matrix)

    @classmethod
    @functools.cache
    def of(cls, arm_pair: ArmPair, arm: Arm) -> "ArmKinematics":
        """Kinematics of one arm of a pair."""
        return cls(arm_pair.base_pose(arm), arm_pair.joint_lower, arm_pair.joint_upper)

    def fk(self, joints: Array) -> Array:
        """Pose (4, 4) for joints (7,) in rad."""
        return self._base_matrix @ _frankik.fk(joints)

    def pose(self, joints: Array) -> Pose:
        """The same as `fk`, as a position and a quaternion."""
        return Pose.from_matrix(self.fk(joints))

    def ik(self, target: Array, near_q7: float | None = None) -> Array:
        """Joint solutions (n, 7) of a pose (4, 4), within the limits.

        Args:
            target: (4, 4) pose.
            near_q7: Search a fine grid around this redundancy angle, which itself is included; without it, a
                coarse grid over the joint's whole range.
        """
        seed = np.zeros(JOINTS_PER_ARM)
        size, span = GRID_SIZE, GRID_SPAN_DEG
        if near_q7 is not None:
            seed[-1] = near_q7
            size, span = NEAR_GRID_SIZE, NEAR_GRID_SPAN_DEG
        found = _frankik.ik_sample_q7(self.in_base(target) @ TCP_T_FLANGE, seed, False, size, span, True)
        solutions = np.concatenate(found or [seed[:0]]).reshape(-1, JOINTS_PER_ARM)
        return solutions[self.within_limits(solutions)]

    def in_base(self, poses: Array) -> Array:
        """World poses (..., 4, 4) in the frame of the arm's base."""
        return self._to_base @ poses

    def reaches(self, joints: Array, target: Array) -> bool:
        """Whether joints (7,) put the hand at a pose (4, 4) exactly.

        At the very edge of a branch, and where joints 1 and 3 turn about one axis, the closed form clips its
        arguments: one solution in a thousand is off by up to 2 mm. So whoever uses a solution checks it.
        """
        return bool(np.abs(self.fk(joints) - target).max() < EXACT)

    def within_limits(self, joints: Array) -> NDArray[np.bool_]:
        """Whether joints (..., 7) keep the safety distance from all limits; false for NaN."""
        inside = (joints > self.lower + LIMIT_SAFETY_RAD) & (joints < self.upper - LIMIT_SAFETY_RAD)
        return np.all(inside, axis=-1)

    def margins(self, joints: ArrayLike) -> Array:
        """Distance of each joint (..., 7) to its nearer limit, as a fraction of the joint's range."""
        joints = np.asarray(joints, dtype=np.float64)
        return np.minimum(joints - self.lower, self.upper - joints) / (self.upper - self.lower)

    def limit_closeness(self, joints: Array) -> Array:
        """How near postures (n, 7) are to their limits: the sum over joints of one over the margin."""
        return (1.0 / np.maximum(self.margins(joints), 1e-3)).sum(axis=-1)

    def posture_cost(self, joints: Array, start: Array, margin_weight: float) -> Array:
        """How unwelcome postures (n, 7) are: squared joint travel from `start` (7,), plus closeness to limits."""
        return ((joints - start) ** 2).sum(axis=-1) + margin_weight * self.limit_closeness(joints)

    def distinct(self, ranked: Array, target: Array, difference_rad: float) -> Iterator[Array]:
        """Those of ranked solutions (n, 7) of a pose (4, 4) that are exact and clearly differ from all before."""
        eligible = np.ones(len(ranked), dtype=bool)
        while eligible.any():
            best = eligible.argmax()
            eligible[best] = False
            if self.reaches(ranked[best], target):
                yield ranked[best]
                eligible &= np.abs(ranked - ranked[best]).max(axis=1) > difference_rad
