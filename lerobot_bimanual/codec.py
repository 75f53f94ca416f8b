"""Discrete keyposes: voxel indices, rotation bins and flags, in NumPy.

The same discretisation that the policies predict (`codec_torch` is its torch twin) rounds the experts'
keyposes when the expert's success with rounded keyposes is measured.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual import keypose_layout as layout
from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations import (
    euler_xyz_to_quat_wxyz,
    quat_wxyz_canonical,
    quat_wxyz_to_euler_xyz,
)
from lerobot_bimanual.keypose import BimanualKeypose


@dataclass(frozen=True, eq=False)
class DiscreteKeypose:
    """A keypose of both arms in bins, left first.

    Attributes:
        voxel: (..., 2, 3) index along x, y, z; outside [0, voxels) where the position lies outside.
        rotation: (..., 2, 3) bin of each extrinsic xyz Euler angle; bin k means `rotation_bin_deg` * k - 180 degrees.
        gripper_open: (..., 2) 0 or 1.
        ignore_collisions: (..., 2) 0 or 1.
    """

    voxel: NDArray[np.int64]
    rotation: NDArray[np.int64]
    gripper_open: NDArray[np.int64]
    ignore_collisions: NDArray[np.int64]


class KeyposeCodec(layout.KeyposeGrid):
    """Between continuous keyposes and bins."""

    def encode(self, vectors: ArrayLike) -> DiscreteKeypose:
        """Bins of flat keyposes (..., 18); positions outside the workspace get indices outside the grid."""
        array = np.asarray(vectors, dtype=np.float64)
        arms = array.reshape(*array.shape[:-1], len(ARMS), layout.ARM_KEYPOSE_DIM)
        voxel = np.floor((arms[..., layout.POSITION] - self.workspace.lower) / self.voxel_size_m)
        euler_deg = np.rad2deg(quat_wxyz_to_euler_xyz(quat_wxyz_canonical(arms[..., layout.QUATERNION])))
        rotation = np.round((euler_deg + 180) / self.rotation_bin_deg).astype(np.int64) % self.rotation_bins
        return DiscreteKeypose(
            voxel.astype(np.int64),
            rotation,
            (arms[..., layout.GRIPPER_OPEN] > 0.5).astype(np.int64),
            (arms[..., layout.IGNORE_COLLISIONS] > 0.5).astype(np.int64),
        )

    def decode(self, discrete: DiscreteKeypose) -> NDArray[np.float64]:
        """Flat keyposes (..., 18) at the voxel centres and bin angles."""
        arms = np.empty((*discrete.voxel.shape[:-1], layout.ARM_KEYPOSE_DIM))
        arms[..., layout.POSITION] = self.workspace.lower + (discrete.voxel + 0.5) * self.voxel_size_m
        euler_rad = np.deg2rad(discrete.rotation * self.rotation_bin_deg - 180)
        arms[..., layout.QUATERNION] = euler_xyz_to_quat_wxyz(euler_rad)
        arms[..., layout.GRIPPER_OPEN] = discrete.gripper_open
        arms[..., layout.IGNORE_COLLISIONS] = discrete.ignore_collisions
        return arms.reshape(*arms.shape[:-2], layout.KEYPOSE_DIM)

    def discretise(self, keypose: BimanualKeypose) -> BimanualKeypose:
        """The keypose that a policy with these bins would command; positions are clipped into the grid."""
        bins = self.encode(keypose.to_vector().astype(np.float64))
        inside = replace(bins, voxel=np.clip(bins.voxel, 0, self.voxels - 1))
        return BimanualKeypose.from_vector(self.decode(inside))
