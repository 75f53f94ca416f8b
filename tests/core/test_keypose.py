"""The flat keypose layout."""

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.errors import InvalidAction
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM, KEYPOSE_NAMES


def example() -> BimanualKeypose:
    left = Keypose(Pose.upright([0.1, 0.2, 0.9], 0.5), gripper_open=True, ignore_collisions=False)
    right = Keypose(Pose.upright([0.3, -0.2, 1.0], -2.0), gripper_open=False, ignore_collisions=True)
    return BimanualKeypose(left, right)


def test_vector_round_trip_keeps_poses_and_flags():
    keypose = example()
    back = BimanualKeypose.from_vector(keypose.to_vector())
    for arm in ARMS:
        distance, angle = keypose[arm].pose.distance_to(back[arm].pose)
        assert distance < 1e-6
        assert angle < 1e-6
        assert back[arm].gripper_open == keypose[arm].gripper_open
        assert back[arm].ignore_collisions == keypose[arm].ignore_collisions


def test_left_arm_comes_first_and_every_element_is_named():
    vector = example().to_vector()
    named = dict(zip(KEYPOSE_NAMES, vector, strict=True))
    assert vector.shape == (KEYPOSE_DIM,) == (18,)
    assert vector.dtype == np.float32
    assert KEYPOSE_NAMES[0] == "left_x"
    assert named["left_y"] == np.float32(0.2)
    assert named["right_gripper_open"] == 0.0
    assert named["right_ignore_collisions"] == 1.0


def test_learned_values_are_normalised():
    vector = example().to_vector()
    vector[3:7] *= -3.0
    vector[7] = 0.51
    keypose = BimanualKeypose.from_vector(vector)
    np.testing.assert_allclose(np.linalg.norm(keypose.left.pose.quat_wxyz), 1.0)
    assert keypose.left.pose.distance_to(example().left.pose)[1] < 1e-6
    assert keypose.left.gripper_open


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: v[:16], "shape"),
        (lambda v: np.where(np.arange(18) == 9, np.nan, v), "right_x"),
        (lambda v: np.where((np.arange(18) > 2) & (np.arange(18) < 7), 0.0, v), "left arm"),
    ],
    ids=["wrong length", "not finite", "zero quaternion"],
)
def test_bad_vectors_are_refused_with_a_reason(change, message):
    with pytest.raises(InvalidAction, match=message):
        BimanualKeypose.from_vector(change(example().to_vector()))
