"""Closed-form kinematics of one Franka arm, vectorised over poses and redundancy angles.

Seven joints reach a pose in a one-parameter family of ways. With the last angle q7 given, the rest is closed
form: q7 fixes the wrist centre, its distance from the shoulder fixes the elbow angle q4, and the wrist and the
shoulder each leave two choices. The search over q7 is a batch, so whole lines are solved in one call.

Dimensions are the published modified Denavit-Hartenberg parameters of the Franka arm with its hand.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import JOINTS_PER_ARM, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.robots.arm_pair import ArmPair

Array = NDArray[np.float64]

SHOULDER_HEIGHT_M = 0.333
UPPER_ARM_M = 0.316
ELBOW_OFFSET_M = 0.0825
FOREARM_M = 0.384
WRIST_OFFSET_M = 0.088
WRIST_TO_TCP_M = 0.107 + 0.1034
"""Flange beyond joint 7, and the hand's tool centre point beyond the flange."""
HAND_YAW_RAD = -np.pi / 4
"""The hand is mounted turned about the flange axis."""

# Squared shoulder-wrist distance = REACH_MEAN + REACH_SWING * cos(q4 + ELBOW_PHASE), from the elbow's two offsets.
REACH_MEAN = 2 * ELBOW_OFFSET_M**2 + UPPER_ARM_M**2 + FOREARM_M**2
_ELBOW = (UPPER_ARM_M * FOREARM_M - ELBOW_OFFSET_M**2, ELBOW_OFFSET_M * (UPPER_ARM_M + FOREARM_M))
REACH_SWING = 2 * float(np.hypot(*_ELBOW))
ELBOW_PHASE = float(np.arctan2(_ELBOW[1], _ELBOW[0]))

LIMIT_SAFETY_RAD = 0.02
"""Distance that every solution keeps from the joint limits."""
Q7_GRID = np.linspace(-2.85, 2.85, 77)
"""Redundancy angles tried for a free goal, rad."""

SOLUTIONS = 4


@dataclass(frozen=True, eq=False)
class ArmKinematics:
    """Forward and inverse kinematics of one arm at its place in the world.

    Attributes:
        base: World pose of the arm's base.
        lower: (7,) rad, lower joint limits.
        upper: (7,) rad, upper joint limits.
    """

    base: Pose
    lower: Array
    upper: Array

    @classmethod
    def of(cls, arm_pair: ArmPair, arm: Arm) -> "ArmKinematics":
        """Kinematics of one arm of a pair."""
        return cls(arm_pair.base_pose(arm), arm_pair.joint_lower, arm_pair.joint_upper)

    def fk(self, joints: ArrayLike) -> Array:
        """World poses of the tool centre point as matrices (..., 4, 4) for joints (..., 7) in rad."""
        joints = np.asarray(joints, dtype=np.float64)
        flat = joints.reshape(-1, JOINTS_PER_ARM)
        x, y, z, position = _hand_frame(flat)
        in_base = np.zeros((len(flat), 4, 4))
        in_base[:, :3, 0], in_base[:, :3, 1], in_base[:, :3, 2] = x.T, y.T, z.T
        in_base[:, :3, 3] = position.T
        in_base[:, 3, 3] = 1.0
        return (self.base.matrix @ in_base).reshape(*joints.shape[:-1], 4, 4)

    def pose(self, joints: ArrayLike) -> Pose:
        """World pose of the tool centre point for joints (7,) in rad."""
        return Pose.from_matrix(self.fk(joints))

    def ik(self, pose: Pose, q7: Array = Q7_GRID) -> Array:
        """All joint solutions (n, 7) of a world pose within the limits, for the redundancy angles `q7` (m,)."""
        solutions = self.ik_batch(np.broadcast_to(pose.matrix, (len(q7), 4, 4)), q7)
        return solutions[~np.isnan(solutions[..., 0])]

    def ik_batch(self, world_T_tcp: Array, q7: Array) -> Array:
        """Joint solutions for pairs of pose and redundancy angle.

        Args:
            world_T_tcp: (n, 4, 4) poses of the tool centre point.
            q7: (n,) rad.

        Returns:
            (n, 4, 7) rad, always the same branch in the same row; NaN where a branch does not exist or leaves
            the joint limits.
        """
        in_base = self.base.inverse().matrix @ world_T_tcp
        solutions = _solve(in_base[:, :3, :3].transpose(1, 2, 0), in_base[:, :3, 3].T, q7)
        inside = (solutions > self.lower + LIMIT_SAFETY_RAD) & (solutions < self.upper - LIMIT_SAFETY_RAD)
        return np.where(inside.all(axis=-1, keepdims=True), solutions, np.nan)

    def margins(self, joints: ArrayLike) -> Array:
        """Distance of each joint (..., 7) to its nearer limit, as a fraction of the joint's range."""
        joints = np.asarray(joints, dtype=np.float64)
        return np.minimum(joints - self.lower, self.upper - joints) / (self.upper - self.lower)


def _hand_frame(joints: Array) -> tuple[Array, Array, Array, Array]:
    """Axes and origin (3, n) of the hand in the base frame; each joint turns two axes of the frame before it."""
    sine, cosine = np.sin(joints.T), np.cos(joints.T)
    zero, one = np.zeros_like(sine[0]), np.ones_like(sine[0])
    x1, y1, z1 = np.stack([cosine[0], sine[0], zero]), np.stack([-sine[0], cosine[0], zero]), np.stack([zero, zero, one])
    x2, z2, z3 = cosine[1] * x1 - sine[1] * z1, y1, sine[1] * x1 + cosine[1] * z1
    x3, y3 = _turn(x2, z2, sine[2], cosine[2])
    x4, y4 = _turn(x3, z3, sine[3], cosine[3])
    z4, z5 = -y3, y4
    x5, y5 = _turn(x4, -z4, sine[4], cosine[4])
    x6, y6 = _turn(x5, z5, sine[5], cosine[5])
    z6, z7 = -y5, -y6
    x7, y7 = _turn(x6, z6, sine[6], cosine[6])
    x, y = _turn(x7, y7, np.sin(HAND_YAW_RAD), np.cos(HAND_YAW_RAD))
    position = (
        SHOULDER_HEIGHT_M * z1
        + UPPER_ARM_M * z3
        + ELBOW_OFFSET_M * (x3 - x4)
        + FOREARM_M * z5
        + WRIST_OFFSET_M * x6
        + WRIST_TO_TCP_M * z7
    )
    return x, y, z7, position


def _solve(rotation: Array, position: Array, q7: Array) -> Array:
    """Closed-form inverse kinematics in the base frame, limits ignored.

    Args:
        rotation: (3, 3, n), columns are the hand's axes.
        position: (3, n) of the tool centre point.
        q7: (n,) rad.

    Returns:
        (n, 4, 7) rad; NaN where a branch does not exist. Elbows straighter than `ELBOW_PHASE` are left out.
    """
    x7, y7 = _turn(rotation[:, 0], rotation[:, 1], np.sin(-HAND_YAW_RAD), np.cos(-HAND_YAW_RAD))
    z7 = rotation[:, 2]
    x6, z6 = _turn(x7, y7, np.sin(-q7), np.cos(q7))
    wrist = position - WRIST_TO_TCP_M * z7 - WRIST_OFFSET_M * x6
    reach = wrist - np.array([[0.0], [0.0], [SHOULDER_HEIGHT_M]])

    solutions = np.full((len(q7), SOLUTIONS, JOINTS_PER_ARM), np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        q4 = -ELBOW_PHASE - np.arccos((_dot(reach, reach) - REACH_MEAN) / REACH_SWING)
        sin4, cos4 = np.sin(q4), np.cos(q4)
        # The shoulder-wrist vector in the elbow's frame: across and along the forearm.
        across = ELBOW_OFFSET_M * (cos4 - 1) + UPPER_ARM_M * sin4
        along = FOREARM_M + UPPER_ARM_M * cos4 - ELBOW_OFFSET_M * sin4
        # The forearm axis z5 = sin(q6) x6 - cos(q6) z7 must have the component `along` in that vector.
        reach_x6, reach_z7 = _dot(reach, x6), _dot(reach, z7)
        phase = np.arctan2(reach_z7, reach_x6)
        lift = np.arcsin(along / np.hypot(reach_x6, reach_z7))
        for wrist_choice, q6 in enumerate((phase + lift, phase + np.pi - lift)):
            sin6, cos6 = np.sin(q6), np.cos(q6)
            z5, x5 = sin6 * x6 - cos6 * z7, cos6 * x6 + sin6 * z7
            x4 = (reach - along * z5) / across
            z4 = _cross(x4, z5)
            q5 = np.arctan2(-_dot(x5, z4), _dot(x5, x4))
            x3, z3 = cos4 * x4 - sin4 * z5, sin4 * x4 + cos4 * z5
            q1, q2 = np.arctan2(z3[1], z3[0]), np.arccos(np.clip(z3[2], -1.0, 1.0))
            sin1, cos1 = np.sin(q1), np.cos(q1)
            q3 = np.arctan2(x3[1] * cos1 - x3[0] * sin1, z4[0] * sin1 - z4[1] * cos1)
            for flip in (0, 1):
                row = solutions[:, 2 * wrist_choice + flip]
                row[:, 0] = _wrap(q1 + np.pi * flip)
                row[:, 1] = -q2 if flip else q2
                row[:, 2] = _wrap(q3 + np.pi * flip)
                row[:, 3] = q4
                row[:, 4] = q5
                row[:, 5] = _wrap(q6, around=np.pi / 2)
                row[:, 6] = q7
    solutions[np.isnan(solutions).any(axis=-1)] = np.nan
    return solutions


def _turn(a: Array, b: Array, sine: ArrayLike, cosine: ArrayLike) -> tuple[Array, Array]:
    """Two orthogonal axes (3, n) turned in their plane."""
    return cosine * a + sine * b, cosine * b - sine * a


def _wrap(angle: Array, around: float = 0.0) -> Array:
    """The same angle within half a turn of `around`, rad."""
    return angle - 2 * np.pi * np.round((angle - around) / (2 * np.pi))


def _dot(a: Array, b: Array) -> Array:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
