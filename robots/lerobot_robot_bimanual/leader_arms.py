"""Virtual leader arms controlled per hand in Cartesian space; their joints are the teleoperator's action."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle, quat_wxyz_multiply, rotation_vector
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.robots.kinematics import EXACT, LIMIT_SAFETY_RAD
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR

Array = NDArray[np.floating]

HOME = np.array([*PANDA_PAIR.home_joints, 1.0] * len(ARMS), dtype=np.float32)
HOME_PULL = 0.02
"""Share of the way to the home posture that the initial guess of every step takes, so that elbows do not drift."""
MAX_JOINT_STEP_RAD = 0.5
"""Largest change of a joint in one step; beyond it the arm would switch to another posture."""
MAX_NEWTON_STEPS = 10
MIN_SINGULAR_SHARE = 1e-3
"""Singular values smaller than this share of the largest count as zero."""


class LeaderArms:
    """Joints and openings of both arms, initially at home.

    Attributes:
        joint_action: (16,) float32, see `lerobot_bimanual.arms`.
    """

    def __init__(self) -> None:
        self.joint_action = HOME.copy()

    def go_home(self) -> None:
        """Move both arms home and open the hands."""
        self.joint_action = HOME.copy()

    def go_to(self, joint_action: ArrayLike) -> None:
        """Move both arms to a joint action (16,), within the limits."""
        pair = PANDA_PAIR
        lower = [*(pair.joint_lower + LIMIT_SAFETY_RAD), 0.0] * len(ARMS)
        upper = [*(pair.joint_upper - LIMIT_SAFETY_RAD), 1.0] * len(ARMS)
        self.joint_action = np.clip(joint_action, lower, upper).astype(np.float32)

    def hand(self, arm: Arm) -> Pose:
        """World pose of a hand's tool centre point."""
        return PANDA_PAIR.kinematics[arm].pose(self._joints(arm))

    def move(self, arm: Arm, offset_m: ArrayLike, turn_rad: ArrayLike) -> bool:
        """Move and turn a hand, or leave it where it is if the arm cannot follow.

        Args:
            arm: arm of the hand.
            offset_m: (3,) along the world's axes.
            turn_rad: (3,) rotation vector in the world's axes.

        Returns:
            Whether the arm could follow.
        """
        hand, turn_rad = self.hand(arm), np.asarray(turn_rad, dtype=np.float64)
        quat_wxyz = hand.quat_wxyz
        if angle_rad := float(np.linalg.norm(turn_rad)):
            quat_wxyz = quat_wxyz_multiply(quat_wxyz_from_axis_angle(turn_rad, angle_rad), quat_wxyz)
        posture = self._posture(arm, Pose(hand.position + np.asarray(offset_m), quat_wxyz))
        if posture is None:
            return False
        by_arm(self.joint_action)[arm.ordinal, :JOINTS_PER_ARM] = posture
        return True

    def switch_gripper(self, arm: Arm) -> None:
        """Close an open hand, open a closed one."""
        opening = by_arm(self.joint_action)[arm.ordinal, -1]
        by_arm(self.joint_action)[arm.ordinal, -1] = float(opening < 0.5)

    def _joints(self, arm: Arm) -> Array:
        return by_arm(self.joint_action)[arm.ordinal, :JOINTS_PER_ARM].astype(np.float64)

    def _posture(self, arm: Arm, target: Pose) -> Array | None:
        """Joints (7,) at a pose, by Newton's method from the present ones; None if there are none nearby.

        The nearest solution of the closed form is not continuous where a hand moves far to the side.
        """
        kinematics, start = PANDA_PAIR.kinematics[arm], self._joints(arm)
        wanted = kinematics.in_base(target.matrix)
        joints = start + HOME_PULL * (PANDA_PAIR.home_joints - start)
        for _ in range(MAX_NEWTON_STEPS):
            poses, jacobians = kinematics.poses_and_jacobians(joints[None])
            turn_rad = rotation_vector(wanted[:3, :3] @ poses[0, :3, :3].T)
            error = np.concatenate([wanted[:3, 3] - poses[0, :3, 3], turn_rad])
            if np.abs(error).max() < EXACT:
                is_near = np.abs(joints - start).max() < MAX_JOINT_STEP_RAD
                return joints if is_near and kinematics.within_limits(joints) else None
            joints = joints + np.linalg.pinv(jacobians[0], rcond=MIN_SINGULAR_SHARE) @ error
        return None
