"""Axioms of the rotation conversions, and agreement of the torch twins."""

import numpy as np
import pytest
import torch

from lerobot_bimanual.geometry import rotations, rotations_torch


@pytest.fixture
def quaternions() -> np.ndarray:
    random = np.random.default_rng(0).normal(size=(200, 4))
    half_turns = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, 0.6, 0.8, 0]])
    return rotations.quat_wxyz_canonical(np.concatenate([random, half_turns]))


def same_rotation(a, b, atol=1e-9):
    return bool((rotations.rotation_angle_rad(a, b) < atol).all())


def test_quaternion_to_matrix_and_back_is_the_identity(quaternions):
    back = rotations.matrix_to_quat_wxyz(rotations.quat_wxyz_to_matrix(quaternions))
    assert same_rotation(quaternions, back)
    assert (back[:, 0] >= 0).all()


def test_product_of_quaternions_is_the_product_of_matrices(quaternions):
    a, b = quaternions[:100], quaternions[100:200]
    product = rotations.quat_wxyz_to_matrix(rotations.quat_wxyz_multiply(a, b))
    expected = rotations.quat_wxyz_to_matrix(a) @ rotations.quat_wxyz_to_matrix(b)
    np.testing.assert_allclose(product, expected, atol=1e-12)


def test_euler_angles_round_trip(quaternions):
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
    euler, matrices = (
        torch.from_numpy(convert(quaternions))
        for convert in (rotations.quat_wxyz_to_euler_xyz, rotations.quat_wxyz_to_matrix)
    )
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
