"""Recorded actions and keyposes lead to the same states again, and to others if one of them was changed."""

import pytest
from corruptions import column, plus

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedDataset

pytestmark = pytest.mark.sim


def test_every_recorded_episode_replays_tick_by_tick_and_keypose_by_keypose(generated, played_again) -> None:
    frames, keyframes = (RecordedDataset(generated / view) for view in schema.VIEWS)
    for index in range(len(frames)):
        assert played_again(frames, index) == len(frames.episode(index))
    assert played_again(keyframes, 1) == len(frames.episode(1))


def test_a_changed_action_leads_to_other_states(copy, played_again) -> None:
    root = copy("frames")
    column(schema.ACTION, plus(0.01), [30])(root)
    assert played_again(RecordedDataset(root), 1) == -1
