"""Axioms of poses, boxes, rotations and pinhole cameras, and agreement of the torch twins."""

import math
from itertools import pairwise

import numpy as np
import pytest
import torch

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.geometry import pinhole, pinhole_torch, rotations, rotations_torch
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_canonical
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE


def test_composition_inverse_and_application_are_those_of_matrices():
    rng = np.random.default_rng(1)
    poses = [Pose(rng.normal(size=3), quat_wxyz_canonical(rng.normal(size=4))) for _ in range(20)]
    for a, b in pairwise(poses):
        np.testing.assert_allclose((a @ b).matrix, a.matrix @ b.matrix, atol=1e-12)
    points = np.random.default_rng(2).normal(size=(4, 5, 3))
    for pose in poses:
        np.testing.assert_allclose((pose @ pose.inverse()).matrix, np.eye(4), atol=1e-12)
        np.testing.assert_allclose(pose.inverse().inverse().matrix, pose.matrix, atol=1e-12)
        homogeneous = np.concatenate([points, np.ones((4, 5, 1))], axis=-1) @ pose.matrix.T
        np.testing.assert_allclose(pose.apply(points), homogeneous[..., :3], atol=1e-12)
        distance, angle = Pose.from_matrix(pose.matrix).distance_to(pose)
        assert distance < 1e-12
        assert angle < 1e-9


def test_looking_points_the_hand_along_the_approach_with_fingers_along_the_opening():
    pose = Pose.looking([0.1, 0.2, 0.3], approach=[0, 0, -2], opening=[1, 0, 5])
    np.testing.assert_allclose(pose.rotation @ [0, 0, 1], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(pose.rotation @ [0, 1, 0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(pose.advanced(0.1).position, [0.1, 0.2, 0.2], atol=1e-12)


@pytest.mark.parametrize("approach", [(1, 0, 0), (0, 0, 0)])
def test_a_hand_cannot_open_along_its_approach(approach):
    with (
        np.errstate(invalid="ignore"),
        pytest.raises(BimanualError, match=r"opening .* but must be across it"),
    ):
        Pose.looking((0, 0, 1), approach, opening=(2, 0, 0))


def test_a_pose_does_not_alias_its_arguments():
    position = np.zeros(3)
    pose = Pose(position, np.array([1.0, 0, 0, 0]))
    position[0] = 5.0
    assert pose.position[0] == 0.0


def test_workspace_samples_lie_inside_and_edges_count_as_voxels_do():
    rng = np.random.default_rng(3)
    samples = np.array([VOXEL_WORKSPACE.sample(rng) for _ in range(100)])
    assert VOXEL_WORKSPACE.contains(samples).all()
    assert VOXEL_WORKSPACE.contains(VOXEL_WORKSPACE.lower)
    assert not VOXEL_WORKSPACE.contains(VOXEL_WORKSPACE.upper)
    np.testing.assert_allclose(VOXEL_WORKSPACE.size, 1.0)


@pytest.fixture
def quaternions() -> np.ndarray:
    random = np.random.default_rng(0).normal(size=(200, 4))
    half_turns = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, 0.6, 0.8, 0]])
    return rotations.quat_wxyz_canonical(np.concatenate([random, half_turns]))


def same_rotation(a, b, atol=1e-9):
    return bool((rotations.rotation_angle_rad(a, b) < atol).all())


def test_quaternions_matrices_and_euler_angles_are_one_rotation(quaternions):
    back = rotations.matrix_to_quat_wxyz(rotations.quat_wxyz_to_matrix(quaternions))
    assert same_rotation(quaternions, back)
    assert (back[:, 0] >= 0).all()
    a, b = quaternions[:100], quaternions[100:200]
    product = rotations.quat_wxyz_to_matrix(rotations.quat_wxyz_multiply(a, b))
    expected = rotations.quat_wxyz_to_matrix(a) @ rotations.quat_wxyz_to_matrix(b)
    np.testing.assert_allclose(product, expected, atol=1e-12)
    euler = rotations.quat_wxyz_to_euler_xyz(quaternions)
    assert same_rotation(quaternions, rotations.euler_xyz_to_quat_wxyz(euler), atol=1e-7)
    assert (np.abs(euler[:, 1]) <= np.pi / 2 + 1e-12).all()


def test_euler_angles_are_extrinsic_x_then_y_then_z():
    quarter = np.pi / 2
    turn = rotations.quat_wxyz_to_matrix(rotations.euler_xyz_to_quat_wxyz([quarter, 0.0, quarter]))
    # y goes to z by the turn about x, and stays there under the turn about the fixed z axis.
    np.testing.assert_allclose(turn @ [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(turn @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("pitch_deg", [90.0, -90.0])
def test_equal_rotations_have_equal_angles_at_the_singularity(pitch_deg):
    sign = np.sign(pitch_deg)
    # At pitch +90 only roll - yaw matters, at -90 only roll + yaw.
    a = np.deg2rad([30.0, pitch_deg, 10.0])
    b = np.deg2rad([50.0, pitch_deg, 10.0 + sign * 20.0])
    angles = [rotations.quat_wxyz_to_euler_xyz(rotations.euler_xyz_to_quat_wxyz(e)) for e in (a, b)]
    np.testing.assert_allclose(angles[0], angles[1], atol=1e-6)
    assert angles[0][2] == 0.0


def test_axis_angle_and_rotation_vector_agree():
    axis, angle = np.array([0.0, 3.0, 4.0]), 1.2
    q = rotations.quat_wxyz_from_axis_angle(axis, angle)
    np.testing.assert_allclose(rotations.quat_wxyz_to_rotation_vector(q), axis / 5 * angle, atol=1e-12)
    vector = rotations.rotation_vector(rotations.quat_wxyz_to_matrix(q))
    np.testing.assert_allclose(vector, axis / 5 * angle, atol=1e-12)


def test_torch_twins_agree(quaternions):
    tensor = torch.from_numpy(quaternions)
    euler = torch.from_numpy(rotations.quat_wxyz_to_euler_xyz(quaternions))
    matrices = torch.from_numpy(rotations.quat_wxyz_to_matrix(quaternions))
    for name, *arguments in (
        ("quat_wxyz_canonical", tensor),
        ("quat_wxyz_conjugate", tensor),
        ("quat_wxyz_to_matrix", tensor),
        ("quat_wxyz_to_euler_xyz", tensor),
        ("quat_wxyz_multiply", tensor[:50], tensor[50:100]),
        ("rotation_angle_rad", tensor[:50], tensor[50:100]),
    ):
        expected = getattr(rotations, name)(*(argument.numpy() for argument in arguments))
        np.testing.assert_allclose(getattr(rotations_torch, name)(*arguments).numpy(), expected, atol=1e-9)
    assert same_rotation(rotations_torch.matrix_to_quat_wxyz(matrices).numpy(), quaternions)
    assert same_rotation(rotations_torch.euler_xyz_to_quat_wxyz(euler).numpy(), quaternions, atol=1e-7)


HEIGHT, WIDTH = 12, 16
INTRINSICS = pinhole.intrinsics_from_fovy(np.deg2rad(60), HEIGHT, WIDTH)
WORLD_T_CAMERA = Pose(np.array([0.3, -0.2, 1.1]), quat_wxyz_canonical([0.2, 0.5, -0.3, 0.7])).matrix


def random_depth(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.2, 3.0, size=(HEIGHT, WIDTH))


def test_field_of_view_spans_the_image_height():
    top, bottom = ([0.0, y, 1.0] for y in (-math.tan(np.deg2rad(30)), math.tan(np.deg2rad(30))))
    rows = pinhole.project(np.array([top, bottom]), INTRINSICS, np.eye(4))[:, 1]
    np.testing.assert_allclose(rows, [0.0, HEIGHT], atol=1e-9)


def test_pixels_project_back_to_their_centres_and_invalid_depth_becomes_nan():
    depth = random_depth()
    pixels = pinhole.project(pinhole.unproject(depth, INTRINSICS, WORLD_T_CAMERA), INTRINSICS, WORLD_T_CAMERA)
    rows, columns = np.meshgrid(np.arange(HEIGHT) + 0.5, np.arange(WIDTH) + 0.5, indexing="ij")
    np.testing.assert_allclose(pixels[..., 0], columns, atol=1e-9)
    np.testing.assert_allclose(pixels[..., 1], rows, atol=1e-9)
    np.testing.assert_allclose(pixels[..., 2], depth, atol=1e-12)
    depth = random_depth()
    depth[0, :4] = [0.0, -1.0, np.nan, np.inf]
    points = pinhole.unproject(depth, INTRINSICS, WORLD_T_CAMERA)
    assert np.isnan(points[0, :4]).all()
    assert np.isfinite(points[1:]).all()


def test_torch_unprojection_agrees_for_a_batch_of_cameras():
    depths = np.stack([random_depth(seed) for seed in range(3)])
    depths[1, 2, 3] = 0.0
    transforms = np.stack([WORLD_T_CAMERA, np.eye(4), np.linalg.inv(WORLD_T_CAMERA)])
    expected = np.stack([*map(pinhole.unproject, depths, [INTRINSICS] * 3, transforms)])
    got = pinhole_torch.unproject(*map(torch.from_numpy, (depths, np.stack([INTRINSICS] * 3), transforms)))
    np.testing.assert_allclose(got.mT.numpy(), expected.reshape(3, -1, 3), atol=1e-9)
