"""Two Pandas that face each other across the table: a pair of arms as the rest of the world uses it."""

import functools

import numpy as np

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.robots import panda
from lerobot_env_bimanual.robots.kinematics import ArmKinematics

FINGERS = (1, 2)
ELBOW = 4
"""Number of the joint whose link is the last of the upper arm."""


class ArmPair:
    """Two equal seven-joint arms with parallel grippers; everything that is particular to the robot.

    Names are part of the contract: `<arm>_joint1..7`, `<arm>_finger1/2` (bodies and slide joints),
    `<arm>_actuator1..7`, `<arm>_gripper`, site `<arm>_tcp`, bodies `<arm>_base`, `<arm>_link1..7`,
    `<arm>_hand`, geoms `<arm>_pad1/2`, camera `<arm>_wrist`.
    """

    # PerAct2 ships no scene file; these poses are the ones for which its stored home tips and all its waypoints
    # are reachable. Both bases stand on the table.
    base_poses = (
        Pose.upright((-0.243, 0.022, TABLE_HEIGHT_M), np.deg2rad(5)),
        Pose.upright((0.792, -0.244, TABLE_HEIGHT_M), np.pi),
    )
    """Poses of the left and the right base, world frame."""
    # RLBench's home. Its fourth joint is -0.8727 there, measured from a zero that lies 4 degrees lower.
    home_joints = np.array([0.0, 0.1745, 0.0, -0.803, 0.0, 1.2217, 0.7854])
    """(7,) rad, the joints of either arm at reset."""
    joint_lower, joint_upper = panda.JOINT_LOWER, panda.JOINT_UPPER
    """(7,) rad each."""
    torque_limit_nm = panda.TORQUE_LIMIT_NM
    """(7,) of the real arm's motors, its weight included."""
    velocity_limit_rad_s = panda.VELOCITY_LIMIT_RAD_S
    acceleration_limit_rad_s2, jerk_limit_rad_s3 = panda.ACCELERATION_LIMIT_RAD_S2, panda.JERK_LIMIT_RAD_S3
    """(7,) each, of the real arm's commanded joints."""
    position_gain_nm_rad = panda.POSITION_GAIN
    """(7,) of the joints' servos."""
    servo_lead_s = panda.VELOCITY_GAIN_RATIO_S
    """Time by which a servo lags a moving target; its command is advanced by this times the target's velocity."""
    closed_travel_m = panda.CLOSED_TRAVEL_M
    """Where a closing finger is sent: below zero, so that it still pushes on a thin object."""
    finger_travel_m = panda.FINGER_TRAVEL_M
    """Stroke of one finger, and where an opening one is sent."""
    finger_speed_m_s = panda.FINGER_SPEED_M_S

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write both arms; their actuators come in the order of the joint action."""
        for arm in ARMS:
            panda.add_panda(spec, arm.value, self.base_pose(arm))

    def base_pose(self, arm: Arm) -> Pose:
        """World pose of an arm's base."""
        return self.base_poses[arm.ordinal]

    @functools.cached_property
    def kinematics(self) -> dict[Arm, ArmKinematics]:
        """Kinematics of both arms at their places in the world."""
        return {arm: ArmKinematics(self.base_pose(arm), self.joint_lower, self.joint_upper) for arm in ARMS}

    def joint_names(self, arm: Arm) -> tuple[str, ...]:
        """The seven arm joints, base to wrist."""
        return tuple(f"{arm.value}_joint{i}" for i in range(1, JOINTS_PER_ARM + 1))

    def actuator_names(self, arm: Arm) -> tuple[str, ...]:
        """The arm's eight actuators in the order of the joint action: seven joints, then the gripper."""
        joints = (f"{arm.value}_actuator{i}" for i in range(1, JOINTS_PER_ARM + 1))
        return (*joints, f"{arm.value}_gripper")

    def finger_names(self, arm: Arm) -> tuple[str, ...]:
        """The two fingers: bodies, and slide joints of the same name."""
        return tuple(f"{arm.value}_finger{i}" for i in FINGERS)

    def upper_links(self, arm: Arm) -> tuple[str, ...]:
        """Bodies from the shoulder to the elbow."""
        return tuple(f"{arm.value}_link{i}" for i in range(1, ELBOW + 1))

    def base_body(self, arm: Arm) -> str:
        """Root body of the arm's subtree."""
        return f"{arm.value}_base"

    def hand_body(self, arm: Arm) -> str:
        """Root body of the hand's subtree (palm and fingers)."""
        return f"{arm.value}_hand"

    def tcp_site(self, arm: Arm) -> str:
        """Site of the tool centre point."""
        return f"{arm.value}_tcp"

    def finger_target_m(self, opening: float) -> float:
        """Finger travel to which a hand is sent for an opening of 0 (closed) to 1 (open)."""
        return self.closed_travel_m + opening * (self.finger_travel_m - self.closed_travel_m)


PANDA_PAIR = ArmPair()
