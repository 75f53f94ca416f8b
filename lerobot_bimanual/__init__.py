"""Vocabulary shared by the bimanual environment and the keypose policies.

Importing this package loads NumPy only; torch twins live in modules ending in `_torch`.
"""

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M, VOXEL_WORKSPACE, Workspace
from lerobot_bimanual.keypose import KEYPOSE_DIM, BimanualKeypose, Keypose

__version__ = "0.1.0"

__all__ = [
    "ARMS",
    "CAMERA_NAMES",
    "KEYPOSE_DIM",
    "TABLE_HEIGHT_M",
    "VOXEL_WORKSPACE",
    "Arm",
    "BimanualError",
    "BimanualKeypose",
    "Keypose",
    "KeyposeCodec",
    "Pose",
    "Workspace",
    "__version__",
]
