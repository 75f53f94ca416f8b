"""The flat layout of a keypose of both arms, as actions and datasets have it, and how it is cut into bins.

18 numbers, left arm first; per arm `[x, y, z, qw, qx, qy, qz, gripper_open, ignore_collisions]` in the world frame,
metres. (PerAct2's reference lists the right arm first and quaternions xyzw.)
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE, Workspace

ARM_KEYPOSE_NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz", "gripper_open", "ignore_collisions")
ARM_KEYPOSE_DIM = len(ARM_KEYPOSE_NAMES)
KEYPOSE_NAMES = tuple(f"{arm}_{name}" for arm in ARMS for name in ARM_KEYPOSE_NAMES)
KEYPOSE_DIM = len(KEYPOSE_NAMES)

POSITION = slice(0, 3)
QUATERNION = slice(3, 7)
GRIPPER_OPEN = 7
IGNORE_COLLISIONS = 8
"""Where each part stands in one arm's nine numbers."""


@dataclass(frozen=True)
class KeyposeGrid:
    """The bins of a keypose; `codec.KeyposeCodec` rounds to them, `codec_torch.TorchKeyposeCodec` converts to them and back.

    Attributes:
        workspace: the box that the voxels fill.
        voxels: voxels per axis (paper: 100, so 1 cm; 50 on the paper's real robot).
        rotation_bin_deg: width of a rotation bin (paper: 5 degrees, 72 bins per axis).
    """

    workspace: Workspace = VOXEL_WORKSPACE
    voxels: int = 100
    rotation_bin_deg: float = 5.0

    def __post_init__(self):
        """Refuse bins that do not divide the circle."""
        if self.voxels < 1 or not divides_circle(self.rotation_bin_deg):
            raise ValueError(
                f"voxels={self.voxels} must be at least 1 and rotation_bin_deg={self.rotation_bin_deg} must divide 360"
            )

    @property
    def voxel_size_m(self) -> NDArray[np.float64]:
        """Edge lengths (3,) of one voxel."""
        return self.workspace.size / self.voxels

    @property
    def rotation_bins(self) -> int:
        """Bins per rotation axis."""
        return round(360 / self.rotation_bin_deg)


def divides_circle(angle_deg: float) -> bool:
    """Whether an angle fits into 360 degrees a whole number of times, but for rounding: 3.6 does, and 7 does not."""
    return angle_deg > 0 and math.isclose(round(360 / angle_deg) * angle_deg, 360)
