"""What datasets of replayed episodes hold, and what a new image of a video's frame is compared by."""

import numpy as np
import pytest

from lerobot_bimanual.dataset.schema import EE_POSE
from lerobot_bimanual.episode import Demonstration, EpisodeMeta, Step
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.generation.from_results import _with_reached_keyposes
from lerobot_env_bimanual.verification.rendering import difference


def test_a_keypose_that_is_found_in_joint_actions_has_the_grippers_commanded_there():
    actions = np.ones((20, 16), np.float32)
    by_arm(actions)[:, 1, 0] = 0.02 * np.arange(20)  # it never rests
    by_arm(actions)[9:, 0, -1] = 0
    steps = [Step({EE_POSE: np.full(14, tick)}, action, 0, 0) for tick, action in enumerate(actions)]
    meta = EpisodeMeta("lift_ball", 0, "test", 0, "lift the ball")
    found = _with_reached_keyposes(Demonstration(meta, np.empty((0, 18)), tuple(steps), {}, lambda row: {}))
    left, right = found.keyposes.reshape(-1, 2, 9).transpose(1, 0, 2)
    assert left[:, 0].tolist() == [9, 19]
    assert left[:, 7].tolist() == [0, 0]
    assert right[:, 7].tolist() == [1, 1]


@pytest.mark.parametrize("side", [64, 84])
def test_a_changed_corner_of_a_video_is_found_whatever_the_size_of_its_frames(side):
    new = np.full((side, side, 3), 90, np.uint8)
    assert not difference(new, new, is_video=True)
    for corner in (np.s_[:4, :4], np.s_[:4, -4:], np.s_[-4:, :4], np.s_[-4:, -4:]):
        frame = new.copy()
        frame[corner] = 255
        assert "a block of 8 pixels" in difference(frame, new, is_video=True)
