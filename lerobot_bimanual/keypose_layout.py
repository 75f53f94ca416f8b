"""The flat layout of a keypose of both arms, as actions and datasets have it.

18 numbers, left arm first; per arm `[x, y, z, qw, qx, qy, qz, gripper_open, ignore_collisions]` in the world frame,
metres. (PerAct2's reference lists the right arm first and quaternions xyzw.)
"""

from lerobot_bimanual.arms import ARMS

ARM_KEYPOSE_NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz", "gripper_open", "ignore_collisions")
ARM_KEYPOSE_DIM = len(ARM_KEYPOSE_NAMES)
KEYPOSE_NAMES = tuple(f"{arm}_{name}" for arm in ARMS for name in ARM_KEYPOSE_NAMES)
KEYPOSE_DIM = len(KEYPOSE_NAMES)

POSITION = slice(0, 3)
QUATERNION = slice(3, 7)
GRIPPER_OPEN = 7
IGNORE_COLLISIONS = 8
"""Where each part stands in one arm's nine numbers."""
