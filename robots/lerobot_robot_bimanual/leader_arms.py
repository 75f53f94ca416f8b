"""Two arms in thought, which an operator moves hand by hand; their joints are what the robot is sent."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import (
    quat_wxyz_from_axis_angle,
    quat_wxyz_multiply,
    rotation_vector,
)
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.robots.arm_pair import ArmPair
from lerobot_env_bimanual.robots.kinematics import EXACT, LIMIT_SAFETY_RAD

Array = NDArray[np.floating]

HOMEWARDS = 0.02
"""Share of the way to the posture at home from which the joints of a step are sought, so that elbows do not drift."""
LARGEST_STEP_RAD = 0.5
"""Of a joint in one step; beyond it the arm would have to change its posture."""
MAX_NEWTON_STEPS = 10
LEAST_SINGULAR = 1e-3
"""Singular values smaller than this share of the largest count as zero."""


class LeaderArms:
    """Joints and openings of both arms, at home at first.

    Args:
        arm_pair: whose kinematics, home and joint limits hold.

    Attributes:
        joint_action: (16,) float32, see `lerobot_bimanual.joint_action`.
    """

    def __init__(self, arm_pair: ArmPair):
        self._arm_pair = arm_pair
        self.joint_action = np.zeros(0, dtype=np.float32)
        self.go_home()

    def go_home(self) -> None:
        """Both arms home, hands open."""
        self.joint_action = np.array([*self._arm_pair.home_joints, 1.0] * len(ARMS), dtype=np.float32)

    def go_to(self, joint_action: ArrayLike) -> None:
        """Both arms as a joint action (16,) has them, within the limits."""
        pair = self._arm_pair
        lower = [*(pair.joint_lower + LIMIT_SAFETY_RAD), 0.0] * len(ARMS)
        upper = [*(pair.joint_upper - LIMIT_SAFETY_RAD), 1.0] * len(ARMS)
        self.joint_action = np.clip(joint_action, lower, upper).astype(np.float32)

    def hand(self, arm: Arm) -> Pose:
        """World pose of a hand's tool centre point."""
        return self._arm_pair.kinematics[arm].pose(self._joints(arm))

    def move(self, arm: Arm, offset_m: ArrayLike, turn_rad: ArrayLike) -> bool:
        """Move and turn a hand; where the arm cannot follow, it stays as it is.

        Args:
            arm: whose hand.
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
        """The joints (7,) at a pose, by Newton's method from the present ones.

        The nearest solutions of the closed form jump, and then end, where a hand is moved far to the side.
        """
        kinematics, start = self._arm_pair.kinematics[arm], self._joints(arm)
        wanted = kinematics.in_base(target.matrix)
        joints = start + HOMEWARDS * (self._arm_pair.home_joints - start)
        for _ in range(MAX_NEWTON_STEPS):
            poses, jacobians = kinematics.poses_and_jacobians(joints[None])
            turn_rad = rotation_vector(wanted[:3, :3] @ poses[0, :3, :3].T)
            error = np.concatenate([wanted[:3, 3] - poses[0, :3, 3], turn_rad])
            if np.abs(error).max() < EXACT:
                is_near = np.abs(joints - start).max() < LARGEST_STEP_RAD
                return joints if is_near and kinematics.within_limits(joints) else None
            joints = joints + np.linalg.pinv(jacobians[0], rcond=LEAST_SINGULAR) @ error
        return None
