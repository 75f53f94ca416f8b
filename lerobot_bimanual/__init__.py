"""Vocabulary shared by the bimanual environment and the keypose policies.

Importing this package loads nothing: each name below comes from its module when it is first asked for, so that the
command line answers before NumPy is loaded. Torch twins live in modules ending in `_torch`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lerobot_bimanual.arms import ARMS, Arm
    from lerobot_bimanual.cameras import CAMERA_NAMES
    from lerobot_bimanual.codec import KeyposeCodec
    from lerobot_bimanual.dataset.reader import RecordedDataset
    from lerobot_bimanual.errors import BimanualError
    from lerobot_bimanual.geometry.pose import Pose
    from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M, VOXEL_WORKSPACE, Workspace
    from lerobot_bimanual.keypose import BimanualKeypose, Keypose
    from lerobot_bimanual.keypose_layout import KEYPOSE_DIM

__version__ = "0.1.0"

_MODULES = {
    "ARMS": "arms",
    "CAMERA_NAMES": "cameras",
    "KEYPOSE_DIM": "keypose_layout",
    "TABLE_HEIGHT_M": "geometry.workspace",
    "VOXEL_WORKSPACE": "geometry.workspace",
    "Arm": "arms",
    "BimanualError": "errors",
    "BimanualKeypose": "keypose",
    "Keypose": "keypose",
    "KeyposeCodec": "codec",
    "Pose": "geometry.pose",
    "RecordedDataset": "dataset.reader",
    "Workspace": "geometry.workspace",
}
"""Where each name is defined."""

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
    "RecordedDataset",
    "Workspace",
    "__version__",
]


def __dir__() -> list[str]:
    """What can be imported from here."""
    return __all__


def __getattr__(name: str) -> Any:
    """Import a name's module on first use."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
