"""Keyframe discovery on hand-made recordings."""

import numpy as np

from lerobot_bimanual.keyframes import discover_keyframes


def recording(moving: list[bool], gripper_open: list[bool] | None = None) -> np.ndarray:
    """Actions in which one right joint moves where told and the left gripper follows `gripper_open`."""
    actions = np.zeros((len(moving), 16), dtype=np.float32)
    actions[:, 11] = np.cumsum(np.where(moving, 0.02, 0.0))
    actions[:, [7, 15]] = 1.0
    if gripper_open is not None:
        actions[:, 7] = gripper_open
    return actions


def test_setting_off_after_a_rest_and_the_last_frame_are_keyframes():
    moving = [False] + [True] * 10 + [False] * 4 + [True] * 10 + [False] * 6
    assert discover_keyframes(recording(moving)) == [15, 30]


def test_one_moving_arm_prevents_a_keyframe():
    assert discover_keyframes(recording([False] + [True] * 19)) == [19]


def test_a_gripper_that_closes_at_rest_ends_the_keypose_when_the_rest_ends():
    moving = [False] + [True] * 5 + [False] * 12 + [True] * 5 + [False] * 3
    gripper_open = [True] * 8 + [False] * 18
    assert discover_keyframes(recording(moving, gripper_open)) == [18, 25]


def test_a_gripper_change_while_moving_is_a_keyframe():
    gripper_open = [True] * 8 + [False] * 12
    assert discover_keyframes(recording([False] + [True] * 19, gripper_open)) == [8, 19]


def test_a_gripper_event_before_the_first_motion_is_a_keypose_of_its_own():
    moving = [False] * 12 + [True] * 6 + [False] * 3
    gripper_open = [True] * 2 + [False] * 19
    assert discover_keyframes(recording(moving, gripper_open)) == [12, 20]


def test_grippers_that_change_one_after_the_other_at_rest_are_keyposes_of_their_own():
    moving = [False] + [True] * 5 + [False] * 40
    gripper_open = [True] * 10 + [False] * 20 + [True] * 16
    assert discover_keyframes(recording(moving, gripper_open)) == [20, 45]


def test_resting_at_the_start_alone_is_no_keyframe():
    assert discover_keyframes(recording([False] * 10 + [True] * 5)) == [14]


def test_an_episode_of_one_frame_has_no_keyframe():
    assert discover_keyframes(recording([False])) == []
