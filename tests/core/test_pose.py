"""Axioms of rigid poses and boxes."""

from itertools import pairwise

import numpy as np
import pytest

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_canonical
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE


@pytest.fixture
def poses() -> list[Pose]:
    rng = np.random.default_rng(1)
    return [Pose(rng.normal(size=3), quat_wxyz_canonical(rng.normal(size=4))) for _ in range(20)]


def test_composition_is_the_product_of_matrices(poses):
    for a, b in pairwise(poses):
        np.testing.assert_allclose((a @ b).matrix, a.matrix @ b.matrix, atol=1e-12)


def test_inverse_undoes_the_pose(poses):
    for pose in poses:
        np.testing.assert_allclose((pose @ pose.inverse()).matrix, np.eye(4), atol=1e-12)
        np.testing.assert_allclose(pose.inverse().inverse().matrix, pose.matrix, atol=1e-12)


def test_apply_moves_points_as_the_matrix_does(poses):
    points = np.random.default_rng(2).normal(size=(4, 5, 3))
    for pose in poses:
        homogeneous = np.concatenate([points, np.ones((4, 5, 1))], axis=-1) @ pose.matrix.T
        np.testing.assert_allclose(pose.apply(points), homogeneous[..., :3], atol=1e-12)


def test_matrix_round_trip(poses):
    for pose in poses:
        distance, angle = Pose.from_matrix(pose.matrix).distance_to(pose)
        assert distance < 1e-12
        assert angle < 1e-9


def test_looking_points_the_hand_along_the_approach_with_fingers_along_the_opening():
    pose = Pose.looking([0.1, 0.2, 0.3], approach=[0, 0, -2], opening=[1, 0, 5])
    np.testing.assert_allclose(pose.rotation @ [0, 0, 1], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(pose.rotation @ [0, 1, 0], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(pose.advanced(0.1).position, [0.1, 0.2, 0.2], atol=1e-12)


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
