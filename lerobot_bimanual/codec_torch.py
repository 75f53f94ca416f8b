"""Discrete keyposes on torch tensors: what the policies predict; `codec` rounds keyposes alike, in NumPy."""

from dataclasses import dataclass

import torch
from torch import Tensor

from lerobot_bimanual import keypose_layout as layout
from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations_torch import (
    euler_xyz_to_quat_wxyz,
    quat_wxyz_canonical,
    quat_wxyz_to_euler_xyz,
)


@dataclass(frozen=True, eq=False)
class KeyposeBins:
    """Bins of a batch of keyposes, left first.

    Attributes:
        voxel: (..., 2, 3) int64 index along x, y, z; outside [0, voxels) where the position lies outside.
        rotation: (..., 2, 3) int64 bin of each extrinsic xyz Euler angle; bin k means `rotation_bin_deg` * k - 180
            degrees.
        gripper_open: (..., 2) int64, 0 or 1.
        ignore_collisions: (..., 2) int64, 0 or 1.
        voxel_position: (..., 2, 3) float, the position in voxels, the centre of the first at 0.
    """

    voxel: Tensor
    rotation: Tensor
    gripper_open: Tensor
    ignore_collisions: Tensor
    voxel_position: Tensor


class TorchKeyposeCodec(layout.KeyposeGrid):
    """Between continuous keyposes and bins, on tensors of any device."""

    def encode(self, vectors: Tensor) -> KeyposeBins:
        """Bins of flat keyposes (..., 18); positions outside the workspace get indices outside the grid."""
        arms = vectors.unflatten(-1, (len(ARMS), layout.ARM_KEYPOSE_DIM))
        from_corner_m = arms[..., layout.POSITION] - vectors.new_tensor(self.workspace.lower)
        position = from_corner_m / vectors.new_tensor(self.voxel_size_m)
        euler_deg = torch.rad2deg(quat_wxyz_to_euler_xyz(quat_wxyz_canonical(arms[..., layout.QUATERNION])))
        rotation = ((euler_deg + 180) / self.rotation_bin_deg).round().long() % self.rotation_bins
        return KeyposeBins(
            position.floor().long(),
            rotation,
            (arms[..., layout.GRIPPER_OPEN] > 0.5).long(),
            (arms[..., layout.IGNORE_COLLISIONS] > 0.5).long(),
            position - 0.5,
        )

    def decode(self, discrete: KeyposeBins) -> Tensor:
        """Flat keyposes (..., 18) at the voxel centres and bin angles."""
        return self.assemble(self.voxel_centers(discrete.voxel), discrete)

    def voxel_centers(self, voxel: Tensor) -> Tensor:
        """World positions (..., 3) of voxel indices (..., 3); fractions of a voxel are allowed."""
        lower = torch.tensor(self.workspace.lower, dtype=torch.float32, device=voxel.device)
        size = torch.tensor(self.voxel_size_m, dtype=torch.float32, device=voxel.device)
        return lower + (voxel + 0.5) * size

    def assemble(self, position: Tensor, discrete: KeyposeBins) -> Tensor:
        """Flat keyposes (..., 18) from positions (..., 2, 3) in metres and the other bins."""
        euler_rad = torch.deg2rad(discrete.rotation * self.rotation_bin_deg - 180)
        flags = torch.stack([discrete.gripper_open, discrete.ignore_collisions], dim=-1).to(position)
        arms = torch.cat([position, euler_xyz_to_quat_wxyz(euler_rad).to(position), flags], dim=-1)
        return arms.flatten(-2)
