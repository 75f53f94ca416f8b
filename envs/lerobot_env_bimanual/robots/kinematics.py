"""Kinematics of one arm at its place in the world; a robot supplies the closed forms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.geometry.pose import Pose

Array = NDArray[np.floating]

LIMIT_SAFETY_RAD = 0.02
"""Distance that every solution keeps from the joint limits."""
EXACT = 1e-6
"""Largest error of a solution's pose matrix, m and rad."""


class ArmKinematics(ABC):
    """Forward and inverse kinematics; poses are homogeneous matrices of the tool centre point in the world.

    Args:
        base: world pose of the arm's base.
        lower: (7,) rad, lower joint limits.
        upper: (7,) rad, upper joint limits.

    Attributes:
        near_span_rad: range of the last joint that `ik` searches around a given angle.
    """

    near_span_rad: float

    def __init__(self, base: Pose, lower: Array, upper: Array):
        self.lower = lower
        self.upper = upper
        self._base_matrix = base.matrix
        self._to_base = base.inverse().matrix

    @abstractmethod
    def fk(self, joints: Array) -> Array:
        """Pose (4, 4) for joints (7,) in rad."""

    @abstractmethod
    def ik(self, target: Array, near_q7: float | None = None) -> Array:
        """Joint solutions (n, 7) of a pose (4, 4), within the limits.

        Args:
            target: (4, 4) pose.
            near_q7: search finely around this angle of the last joint, itself included; without it, coarsely over
                the joint's whole range.
        """

    @abstractmethod
    def poses_and_jacobians(self, joints: Array) -> tuple[Array, Array]:
        """Poses and Jacobians of the tool centre point in the frame of the arm's base.

        Args:
            joints: (n, 7) rad.

        Returns:
            Poses (n, 4, 4) and the Jacobian (n, 6, 7): linear over angular velocity per joint velocity.
        """

    def pose(self, joints: Array) -> Pose:
        """The same as `fk`, as a position and a quaternion."""
        return Pose.from_matrix(self.fk(joints))

    def in_base(self, poses: Array) -> Array:
        """World poses (..., 4, 4) in the frame of the arm's base."""
        return self._to_base @ poses

    def reaches(self, joints: Array, target: Array) -> bool:
        """Whether joints (7,) put the hand at a pose (4, 4) exactly.

        A closed form may clip its arguments at the very edge of a branch, so check a solution before use.
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
