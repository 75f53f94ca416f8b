"""Round trips of the keypose codec."""

import numpy as np
import pytest
import torch

from lerobot_bimanual import codec_torch
from lerobot_bimanual.codec import KeyposeCodec
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


@pytest.mark.parametrize("voxels", [25, 50, 100])
def test_round_trip_is_within_half_a_voxel_and_half_a_bin(voxels):
    codec = KeyposeCodec(voxels=voxels)
    vectors = random_keyposes(500)
    before, after = (v.reshape(500, 2, 9) for v in (vectors, codec.decode(codec.encode(vectors))))
    assert np.abs(before[..., :3] - after[..., :3]).max() <= 0.5 / voxels + 1e-9
    euler = [np.rad2deg(quat_wxyz_to_euler_xyz(v[..., 3:7])) for v in (before, after)]
    difference = np.abs((euler[0] - euler[1] + 180) % 360 - 180)
    # Where the rounded pitch reaches 90 degrees the other two angles lose their meaning; compare the rest.
    regular = np.abs(euler[1][..., 1]) < 87
    assert difference[regular].max() <= 2.5 + 1e-4
    assert np.rad2deg(rotation_angle_rad(before[..., 3:7], after[..., 3:7])).max() < 5.0
    np.testing.assert_array_equal(before[..., 7:], after[..., 7:])


def test_half_turns_share_a_bin_and_positions_outside_get_indices_outside():
    codec = KeyposeCodec()
    vector = random_keyposes(1)[0]
    vector[3:7] = [np.cos(np.pi / 2 - 1e-9), 0, 0, np.sin(np.pi / 2 - 1e-9)]
    plus = codec.encode(vector).rotation[0, 2]
    vector[3:7] = [np.cos(np.pi / 2 + 1e-9), 0, 0, np.sin(np.pi / 2 + 1e-9)]
    assert codec.encode(vector).rotation[0, 2] == plus == 0
    vector[0:3] = [-0.35, 0.55, 0.707]
    voxel = codec.encode(vector).voxel[0]
    assert voxel[0] < 0
    assert voxel[1] >= codec.voxels
    assert 0 <= voxel[2] < codec.voxels
    position = codec.discretise(BimanualKeypose.from_vector(vector)).left.pose.position
    np.testing.assert_allclose(position, [-0.295, 0.495, 0.705], atol=1e-6)


def test_torch_twin_gives_the_same_bins_and_poses():
    vectors = random_keyposes(200).astype(np.float32)
    ours = KeyposeCodec(voxels=50)
    twin = codec_torch.TorchKeyposeCodec(voxels=50)
    expected, got = ours.encode(vectors), twin.encode(torch.from_numpy(vectors).double())
    np.testing.assert_array_equal(got.voxel.numpy(), expected.voxel)
    np.testing.assert_array_equal(got.rotation.numpy(), expected.rotation)
    np.testing.assert_array_equal(got.gripper_open.numpy(), expected.gripper_open)
    poses = [v.reshape(200, 2, 9) for v in (twin.decode(got).numpy(), ours.decode(expected))]
    np.testing.assert_allclose(poses[0][..., :3], poses[1][..., :3], atol=1e-6)
    # Half turns have two canonical quaternions, so rotations are compared as rotations.
    assert rotation_angle_rad(poses[0][..., 3:7], poses[1][..., 3:7]).max() < 1e-3


@pytest.mark.parametrize(("width_deg", "bins"), [(3.6, 100), (0.9, 400), (7.2, 50), (5, 72)])
def test_widths_that_divide_the_circle_but_for_rounding_are_taken(width_deg, bins):
    assert KeyposeCodec(rotation_bin_deg=width_deg).rotation_bins == bins


@pytest.mark.parametrize("width_deg", [7, 0, -5, 3.61])
def test_widths_that_do_not_divide_the_circle_are_refused(width_deg):
    with pytest.raises(ValueError, match=f"rotation_bin_deg={width_deg} must divide 360"):
        KeyposeCodec(rotation_bin_deg=width_deg)
