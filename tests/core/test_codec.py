"""Rounding of keyposes, in NumPy and torch."""

import numpy as np
import pytest
import torch

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.geometry.rotations import (
    quat_wxyz_canonical,
    quat_wxyz_to_euler_xyz,
    rotation_angle_rad,
)
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_bimanual.keypose import BimanualKeypose


def random_keyposes(count: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    arms = np.empty((count, 2, 9))
    arms[..., :3] = rng.uniform(VOXEL_WORKSPACE.lower, VOXEL_WORKSPACE.upper, size=(count, 2, 3))
    arms[..., 3:7] = quat_wxyz_canonical(rng.normal(size=(count, 2, 4)))
    arms[..., 7:] = rng.integers(0, 2, size=(count, 2, 2))
    return arms.reshape(count, 18)


def discretised(codec: KeyposeCodec, vectors: np.ndarray) -> np.ndarray:
    return np.array([codec.discretise(BimanualKeypose.from_vector(vector)).to_vector() for vector in vectors])


@pytest.mark.parametrize("voxels", [25, 50, 100])
def test_a_discretised_keypose_is_within_half_a_voxel_and_half_a_bin(voxels):
    vectors = random_keyposes(500)
    before, after = (
        v.reshape(500, 2, 9) for v in (vectors, discretised(KeyposeCodec(voxels=voxels), vectors))
    )
    assert np.abs(before[..., :3] - after[..., :3]).max() <= 0.5 / voxels + 1e-6
    euler = [np.rad2deg(quat_wxyz_to_euler_xyz(v[..., 3:7])) for v in (before, after)]
    difference = np.abs((euler[0] - euler[1] + 180) % 360 - 180)
    # Where the rounded pitch reaches 90 degrees the other two angles lose their meaning; compare the rest.
    regular = np.abs(euler[1][..., 1]) < 87
    assert difference[regular].max() <= 2.5 + 1e-3
    assert np.rad2deg(rotation_angle_rad(before[..., 3:7], after[..., 3:7])).max() < 5.0
    np.testing.assert_array_equal(before[..., 7:], after[..., 7:])


def test_half_turns_share_a_bin_and_positions_outside_get_indices_outside():
    codec = TorchKeyposeCodec()
    vectors = random_keyposes(2)
    for vector, half_rad in zip(vectors, (np.pi / 2 - 1e-9, np.pi / 2 + 1e-9), strict=True):
        vector[3:7] = [np.cos(half_rad), 0, 0, np.sin(half_rad)]
        vector[0:3] = [-0.35, 0.55, 0.707]
    bins = codec.encode(torch.from_numpy(vectors))
    assert bins.rotation[:, 0, 2].tolist() == [0, 0]
    x, y, z = bins.voxel[0, 0].tolist()
    assert x < 0
    assert y >= codec.voxels
    assert 0 <= z < codec.voxels
    np.testing.assert_allclose(discretised(KeyposeCodec(), vectors)[0, :3], [-0.295, 0.495, 0.705], atol=1e-6)


def test_both_codecs_give_the_same_poses():
    vectors = random_keyposes(200).astype(np.float32)
    twin = TorchKeyposeCodec(voxels=50)
    decoded = twin.decode(twin.encode(torch.from_numpy(vectors).double())).numpy()
    expected, got = (v.reshape(200, 2, 9) for v in (discretised(KeyposeCodec(voxels=50), vectors), decoded))
    np.testing.assert_allclose(got[..., :3], expected[..., :3], atol=1e-6)
    # Half turns have two canonical quaternions, so rotations are compared as rotations.
    assert rotation_angle_rad(got[..., 3:7], expected[..., 3:7]).max() < 1e-3
    np.testing.assert_array_equal(got[..., 7:], expected[..., 7:])


@pytest.mark.parametrize(("width_deg", "bins"), [(3.6, 100), (0.9, 400), (7.2, 50), (5, 72)])
def test_widths_that_divide_the_circle_but_for_rounding_are_taken(width_deg, bins):
    assert KeyposeCodec(rotation_bin_deg=width_deg).rotation_bins == bins


@pytest.mark.parametrize("width_deg", [7, 0, -5, 3.61])
def test_widths_that_do_not_divide_the_circle_are_refused(width_deg):
    with pytest.raises(ValueError, match=f"rotation_bin_deg={width_deg} must divide 360"):
        KeyposeCodec(rotation_bin_deg=width_deg)
