"""Keyframe discovery on hand-made recordings."""

import numpy as np
import pytest

from lerobot_bimanual.keyframes import discover_keyframes


def recording(moving: list[bool], gripper_open: list[bool] | None = None) -> np.ndarray:
    """Actions in which one right joint moves where told and the left gripper follows `gripper_open`."""
    actions = np.zeros((len(moving), 16), dtype=np.float32)
    actions[:, 11] = np.cumsum(np.where(moving, 0.02, 0.0))
    actions[:, [7, 15]] = 1.0
    if gripper_open is not None:
        actions[:, 7] = gripper_open
    return actions


@pytest.mark.parametrize(
    ("moving", "gripper_open", "keyframes"),
    [
        ([False] + [True] * 10 + [False] * 4 + [True] * 10 + [False] * 6, None, [15, 30]),
        ([False] + [True] * 19, None, [19]),
        ([False] + [True] * 5 + [False] * 12 + [True] * 5 + [False] * 3, [True] * 8 + [False] * 18, [18, 25]),
        ([False] + [True] * 19, [True] * 8 + [False] * 12, [8, 19]),
        ([False] * 12 + [True] * 6 + [False] * 3, [True] * 2 + [False] * 19, [12, 20]),
        ([False] + [True] * 5 + [False] * 40, [True] * 10 + [False] * 20 + [True] * 16, [20, 45]),
        ([False] * 10 + [True] * 5, None, [14]),
        ([False], None, []),
    ],
    ids=[
        "setting off after a rest, and the last frame",
        "one moving arm prevents a keyframe",
        "a gripper that closes at rest ends the keypose when the rest ends",
        "a gripper change while moving",
        "a gripper event before the first motion",
        "grippers that change one after the other at rest",
        "resting at the start alone is no keyframe",
        "one frame",
    ],
)
def test_keyframes_are_found(moving, gripper_open, keyframes):
    assert discover_keyframes(recording(moving, gripper_open)) == keyframes
