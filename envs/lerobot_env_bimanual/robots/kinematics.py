"""Kinematics of one Panda at its place in the world.

Seven joints reach a pose in a one-parameter family of ways. With the last angle q7 given, the rest has a closed
form (the `frankik` package): up to four solutions. Searching over q7 is therefore a complete search, without
starting values, iterations or random restarts. At the very edge of a branch, and where joints 1 and 3 turn about one
axis, one solution in a thousand is off by up to 2 mm; see `ArmKinematics.is_exact_solution`.
"""

import itertools
from collections.abc import Iterator
from typing import Any

import frankik
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import JOINTS_PER_ARM
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.robots import panda

Array = NDArray[np.floating]

LIMIT_SAFETY_RAD = 0.02
"""Distance that every solution keeps from the joint limits."""
EXACT = 1e-6
"""Largest error of a solution's pose matrix, m and rad."""
GRID_SIZE = 77
GRID_SPAN_DEG = 326.0
"""The redundancy angle q7 is searched at 77 values over its whole range."""
NEAR_GRID_SIZE = 20
NEAR_GRID_SPAN_DEG = 40.0
"""Near a given angle, where the grid is finer."""

# frankik's inverse kinematics aims the flange, its forward kinematics returns the hand's tool centre point.
_frankik: Any = frankik  # its stubs ask for literal array shapes, which NumPy's own types do not carry
_HALF = np.sqrt(0.5)
TCP_T_FLANGE = np.array(
    [[_HALF, -_HALF, 0.0, 0.0], [_HALF, _HALF, 0.0, 0.0], [0.0, 0.0, 1.0, -panda.TCP_M], [0.0, 0.0, 0.0, 1.0]]
)


class ArmKinematics:
    """Forward and inverse kinematics of a Panda; poses are homogeneous matrices of the tool centre point in the world.

    Args:
        base: world pose of the arm's base.
        lower: (7,) rad, lower joint limits.
        upper: (7,) rad, upper joint limits.
    """

    def __init__(self, base: Pose, lower: Array, upper: Array):
        self.lower = lower
        self.upper = upper
        self._base_matrix = base.matrix
        self._to_base = base.inverse().matrix

    def fk(self, joints: Array) -> Array:
        """Pose (4, 4) for joints (7,) in rad."""
        return self._base_matrix @ _frankik.fk(joints)

    def ik(self, target: Array, near_q7: float | None = None) -> Array:
        """Joint solutions (n, 7) of a pose (4, 4), within the limits.

        Args:
            target: (4, 4) pose.
            near_q7: search finely around this angle of the last joint, itself included; without it, coarsely over
                the joint's whole range.
        """
        seed = np.zeros(JOINTS_PER_ARM)
        size, span = GRID_SIZE, GRID_SPAN_DEG
        if near_q7 is not None:
            seed[-1] = near_q7
            size, span = NEAR_GRID_SIZE, NEAR_GRID_SPAN_DEG
        found = _frankik.ik_sample_q7(self.in_base(target) @ TCP_T_FLANGE, seed, False, size, span, True)
        solutions = np.concatenate(found or [seed[:0]]).reshape(-1, JOINTS_PER_ARM)
        return solutions[self.within_limits(solutions)]

    def poses_and_jacobians(self, joints: Array) -> tuple[Array, Array]:
        """Poses (n, 4, 4) of the tool centre point for joints (n, 7) in rad, and Jacobians (n, 6, 7), in the arm's base frame.

        Rows of a Jacobian: linear, then angular velocity per joint velocity.
        """
        sine, cosine = (function(joints.T)[..., None, None] for function in (np.sin, np.cos))
        # (7, n, 4, 4), each in the frame of the joint before
        frames = _CONSTANT + sine * _TIMES_SINE + cosine * _TIMES_COSINE
        for before, frame in itertools.pairwise(frames):
            np.matmul(before, frame, out=frame)
        hand = frames[-1] @ _JOINT7_T_TCP

        axis = frames[..., :3, 2].transpose(2, 1, 0)  # (3, n, 7)
        lever = hand[:, :3, 3].T[..., None] - frames[..., :3, 3].transpose(2, 1, 0)
        jacobian = np.empty((len(joints), 6, JOINTS_PER_ARM))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            jacobian[:, i] = axis[j] * lever[k] - axis[k] * lever[j]
            jacobian[:, 3 + i] = axis[i]
        return hand, jacobian

    def pose(self, joints: Array) -> Pose:
        """The same as `fk`, as a position and a quaternion."""
        return Pose.from_matrix(self.fk(joints))

    def in_base(self, poses: Array) -> Array:
        """World poses (..., 4, 4) in the frame of the arm's base."""
        return self._to_base @ poses

    def is_exact_solution(self, joints: Array, target: Array) -> bool:
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
        """Cost of postures (n, 7): squared joint travel from `start` (7,), plus weighted closeness to limits."""
        return ((joints - start) ** 2).sum(axis=-1) + margin_weight * self.limit_closeness(joints)

    def distinct(self, ranked: Array, target: Array, difference_rad: float) -> Iterator[Array]:
        """Yield those of ranked solutions (n, 7) of a pose (4, 4) that are exact and clearly differ from all yielded before."""
        eligible = np.ones(len(ranked), dtype=bool)
        while eligible.any():
            best = eligible.argmax()
            eligible[best] = False
            if self.is_exact_solution(ranked[best], target):
                yield ranked[best]
                eligible &= np.abs(ranked - ranked[best]).max(axis=1) > difference_rad


def _joint_frames() -> tuple[Array, Array, Array]:
    """Terms of the joints' frames: constant, factor of the sine and factor of the cosine of each angle, (7, 1, 4, 4)."""
    constant, sine, cosine = np.zeros((3, JOINTS_PER_ARM, 1, 4, 4))
    sine_twist, cosine_twist = np.sin(panda.LINK_TWIST_RAD), np.cos(panda.LINK_TWIST_RAD)
    cosine[:, 0, 0, 0], sine[:, 0, 0, 1] = 1.0, -1.0
    sine[:, 0, 1, 0] = cosine[:, 0, 1, 1] = cosine_twist
    sine[:, 0, 2, 0] = cosine[:, 0, 2, 1] = sine_twist
    constant[:, 0, 1, 2], constant[:, 0, 2, 2] = -sine_twist, cosine_twist
    constant[:, 0, 0, 3] = panda.LINK_LENGTH_M
    constant[:, 0, 1:3, 3] = constant[:, 0, 1:3, 2] * np.array(panda.LINK_OFFSET_M)[:, None]  # along the axis
    constant[:, 0, 3, 3] = 1.0
    return constant, sine, cosine


_CONSTANT, _TIMES_SINE, _TIMES_COSINE = _joint_frames()
_SINE, _COSINE = np.sin(panda.HAND_YAW_RAD), np.cos(panda.HAND_YAW_RAD)
_JOINT7_T_TCP = np.array(
    [[_COSINE, -_SINE, 0, 0], [_SINE, _COSINE, 0, 0], [0, 0, 1, panda.FLANGE_M + panda.TCP_M], [0, 0, 0, 1]]
)
