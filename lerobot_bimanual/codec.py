"""Rounds keyposes in NumPy to those that a policy can predict.

This rounding serves to measure the experts' success with rounded keyposes. `codec_torch` has the bins as tensors, for
the policies.
"""

import numpy as np

from lerobot_bimanual import keypose_layout as layout
from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations import (
    euler_xyz_to_quat_wxyz,
    quat_wxyz_canonical,
    quat_wxyz_to_euler_xyz,
)
from lerobot_bimanual.keypose import BimanualKeypose


class KeyposeCodec(layout.KeyposeGrid):
    """Rounds keyposes to the voxels and bins that policies predict."""

    def discretise(self, keypose: BimanualKeypose) -> BimanualKeypose:
        """The keypose that a policy with these bins would command; positions are clipped into the grid."""
        arms = keypose.to_vector().astype(np.float64).reshape(len(ARMS), layout.ARM_KEYPOSE_DIM)
        voxel = np.floor((arms[:, layout.POSITION] - self.workspace.lower) / self.voxel_size_m)
        inside = np.clip(voxel, 0, self.voxels - 1)
        euler_deg = np.rad2deg(quat_wxyz_to_euler_xyz(quat_wxyz_canonical(arms[:, layout.QUATERNION])))
        rotation = np.round((euler_deg + 180) / self.rotation_bin_deg) % self.rotation_bins
        arms[:, layout.POSITION] = self.workspace.lower + (inside + 0.5) * self.voxel_size_m
        arms[:, layout.QUATERNION] = euler_xyz_to_quat_wxyz(
            np.deg2rad(rotation * self.rotation_bin_deg - 180)
        )
        return BimanualKeypose.from_vector(arms.ravel())
