"""Two Pandas that face each other across the table."""

import numpy as np

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.robots import panda
from lerobot_env_bimanual.robots.arm_pair import ArmPair, JointLimits

PANDA_PAIR = ArmPair(
    # PerAct2 ships no scene file; these poses are the ones for which its stored home tips and all its waypoints
    # are reachable. Both bases stand on the table.
    base_poses=(
        Pose.upright((-0.243, 0.022, TABLE_HEIGHT_M), np.deg2rad(5)),
        Pose.upright((0.792, -0.244, TABLE_HEIGHT_M), np.pi),
    ),
    # RLBench's home. Its fourth joint is -0.8727 there, measured from a zero that lies 4 degrees lower.
    home_joints=np.array([0.0, 0.1745, 0.0, -0.803, 0.0, 1.2217, 0.7854]),
    joint_lower=panda.JOINT_LOWER,
    joint_upper=panda.JOINT_UPPER,
    joint_limits=JointLimits(
        np.array(panda.TORQUE_LIMIT_NM),
        panda.VELOCITY_LIMIT_RAD_S,
        panda.ACCELERATION_LIMIT_RAD_S2,
        panda.JERK_LIMIT_RAD_S3,
    ),
    position_gain_nm_rad=panda.POSITION_GAIN,
    servo_lead_s=panda.VELOCITY_GAIN_RATIO_S,
    closed_travel_m=panda.CLOSED_TRAVEL_M,
    finger_travel_m=panda.FINGER_TRAVEL_M,
    finger_speed_m_s=panda.FINGER_SPEED_M_S,
    add_arm=panda.add_panda,
)
