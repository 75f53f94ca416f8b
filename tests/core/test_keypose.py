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


def recording(moving: list[bool], gripper_open: list[bool] | None = None) -> np.ndarray:
    """Actions in which one right joint moves where told and the left gripper follows `gripper_open`."""
    actions = np.zeros((len(moving), 16), dtype=np.float32)
    actions[:, 11] = np.cumsum(np.where(moving, 0.02, 0.0))
    actions[:, [7, 15]] = 1.0
    if gripper_open is not None:
        actions[:, 7] = gripper_open
    return actions


RECORDINGS = {
    "setting off after a rest, and the last frame": (
        [False] + [True] * 10 + [False] * 4 + [True] * 10 + [False] * 6,
        None,
        [15, 30],
    ),
    "one moving arm prevents a keyframe": ([False] + [True] * 19, None, [19]),
    "a gripper that closes at rest ends the keypose when the rest ends": (
        [False] + [True] * 5 + [False] * 12 + [True] * 5 + [False] * 3,
        [True] * 8 + [False] * 18,
        [18, 25],
    ),
    "a gripper change while moving": ([False] + [True] * 19, [True] * 8 + [False] * 12, [8, 19]),
    "a gripper event before the first motion": (
        [False] * 12 + [True] * 6 + [False] * 3,
        [True] * 2 + [False] * 19,
        [12, 20],
    ),
    "grippers that change one after the other at rest": (
        [False] + [True] * 5 + [False] * 40,
        [True] * 10 + [False] * 20 + [True] * 16,
        [20, 45],
    ),
    "resting at the start alone is no keyframe": ([False] * 10 + [True] * 5, None, [14]),
    "one frame": ([False], None, []),
}


@pytest.mark.parametrize(("moving", "gripper_open", "keyframes"), RECORDINGS.values(), ids=RECORDINGS)
def test_keyframes_are_found(moving, gripper_open, keyframes):
    assert discover_keyframes(recording(moving, gripper_open)) == keyframes
