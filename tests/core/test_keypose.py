"""The flat keypose layout, and keyframe discovery on hand-made recordings."""

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.errors import InvalidAction
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.joint_action import discover_keyframes
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM, KEYPOSE_NAMES


def example() -> BimanualKeypose:
    left = Keypose(Pose.upright([0.1, 0.2, 0.9], 0.5), gripper_open=True, ignore_collisions=False)
    right = Keypose(Pose.upright([0.3, -0.2, 1.0], -2.0), gripper_open=False, ignore_collisions=True)
    return BimanualKeypose(left, right)


def test_vectors_keep_poses_and_flags_left_arm_first_and_learned_values_are_normalised():
    keypose = example()
    back = BimanualKeypose.from_vector(keypose.to_vector())
    for arm in ARMS:
        distance, angle = keypose[arm].pose.distance_to(back[arm].pose)
        assert distance < 1e-6
        assert angle < 1e-6
        assert back[arm].gripper_open == keypose[arm].gripper_open
        assert back[arm].ignore_collisions == keypose[arm].ignore_collisions
    vector = example().to_vector()
    named = dict(zip(KEYPOSE_NAMES, vector, strict=True))
    assert vector.shape == (KEYPOSE_DIM,) == (18,)
    assert vector.dtype == np.float32
    assert KEYPOSE_NAMES[0] == "left_x"
    assert named["left_y"] == np.float32(0.2)
    assert named["right_gripper_open"] == 0.0
    assert named["right_ignore_collisions"] == 1.0
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


def recording(moving: tuple[int, ...], gripper_open: tuple[int, ...]) -> np.ndarray:
    """Actions of a right joint that rests, moves, rests, ... and of a left gripper that is open, closed, ... for so many frames."""
    moves = np.repeat(np.arange(len(moving)) % 2 == 1, moving)
    actions = np.zeros((len(moves), 16), dtype=np.float32)
    actions[:, 11] = np.cumsum(np.where(moves, 0.02, 0.0))
    actions[:, 7] = np.repeat(np.arange(len(gripper_open)) % 2 == 0, gripper_open)
    actions[:, 15] = 1.0
    return actions


RECORDINGS = {
    "setting off after a rest, and the last frame": ((1, 10, 4, 10, 6), (31,), [15, 30]),
    "one moving arm prevents a keyframe": ((1, 19), (20,), [19]),
    "a gripper that closes at rest ends the keypose with the rest": ((1, 5, 12, 5, 3), (8, 18), [18, 25]),
    "a gripper change while moving": ((1, 19), (8, 12), [8, 19]),
    "a gripper event before the first motion": ((12, 6, 3), (2, 19), [12, 20]),
    "grippers that change one after the other at rest": ((1, 5, 40), (10, 20, 16), [20, 45]),
    "grippers that change shortly after each other at rest": ((1, 5, 28), (10, 4, 20), [13, 33]),
    "resting at the start alone is no keyframe": ((10, 5), (15,), [14]),
    "one frame": ((1,), (1,), []),
}


@pytest.mark.parametrize(("moving", "gripper_open", "keyframes"), RECORDINGS.values(), ids=RECORDINGS)
def test_keyframes_are_found(moving, gripper_open, keyframes):
    assert discover_keyframes(recording(moving, gripper_open)) == keyframes
