"""Recorded actions and keyposes replay to the same states, and a dataset that lies is found out."""

import pytest
from corruptions import column, plus, rewrite

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import PROVENANCE_FILE
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.commands.dataset_replay import DatasetReplayConfig, dataset_replay, parse_episodes
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.replay import actions_of, hashes_of, replay, replay_recorded

pytestmark = pytest.mark.sim


def test_every_recorded_episode_replays_tick_by_tick_and_keypose_by_keypose(generated) -> None:
    recorded = RecordedDataset(generated / "frames")
    for view in schema.VIEWS:
        dataset = RecordedDataset(generated / view)
        for index in (2, 0, 1) if view == "frames" else (1,):
            meta, result = replay_recorded(dataset, index)
            assert result.matches
            assert (meta.seed, result.ticks) == (index, len(recorded.episode(index)))


def test_the_command_prints_a_table_and_succeeds(generated, capsys) -> None:
    assert dataset_replay(DatasetReplayConfig(root=generated, workers=1)) == 0
    printed = capsys.readouterr().out
    assert "lift_ball" in printed
    assert "warning" not in printed


def test_a_changed_action_is_found_at_its_tick_and_the_command_names_both(copy, capsys) -> None:
    root = copy("frames")
    column(schema.ACTION, plus(0.01), [30])(root)
    (_, whole), (_, changed) = (replay_recorded(RecordedDataset(root), index) for index in (0, 1))
    assert whole.matches
    assert changed.divergence == 30
    assert dataset_replay(DatasetReplayConfig(root=root, episode_indices="1", workers=1)) == 1
    assert "episode 1 (lift_ball, seed 1): another state after tick 30" in capsys.readouterr().out


@pytest.mark.parametrize(("view", "control_mode"), [("frames", "joint"), ("keyframes", "keypose")])
def test_an_episode_that_ends_earlier_or_later_than_its_record_is_a_divergence(
    generated, view, control_mode
) -> None:
    every_tick, recorded = (RecordedDataset(generated / each).episode(2) for each in ("frames", view))
    meta, length, hashes = recorded.meta, len(every_tick), hashes_of(every_tick, "frames")
    actions = actions_of(recorded, view)
    assert view == "frames" or len(actions) == every_tick.columns[schema.KEYPOSE_STEP][-1] + 1
    env = BimanualEnv(meta.task, split=meta.split, obs="state", control_mode=control_mode)

    def divergence(actions, hashes) -> int | None:
        return replay(env, meta.seed, meta.variation, actions, hashes).divergence

    assert divergence(actions, hashes) is None
    assert divergence([*actions, actions[-1]], hashes) is None  # never taken: the episode is over
    assert divergence(actions, hashes | {length + 1: hashes[length]}) == length
    assert divergence(actions[:-1], hashes) is not None
    shorter = {ticks: state_hash for ticks, state_hash in hashes.items() if ticks < length}
    assert divergence(actions, shorter) == length - 1
    env.close()


def test_another_world_is_named(copy, capsys) -> None:
    root = copy("keyframes")
    rewrite(root / PROVENANCE_FILE, lambda origin: origin["worlds"].update(lift_ball="0123456789ab"))
    config = DatasetReplayConfig(root=root, episode_indices="0", workers=1)
    assert dataset_replay(config) == 0
    assert "warning: it holds lift_ball in world 0123456789ab (here: " in capsys.readouterr().out


def test_episodes_are_chosen_by_index_or_range_and_refused_if_they_are_not_there() -> None:
    assert parse_episodes("all", 3) == [0, 1, 2]
    assert parse_episodes("2,0", 3) == [2, 0]
    assert parse_episodes("1:3", 3) == [1, 2]
    for text in ("3", "-1", "2:1", "x", "", "0:1000000000"):
        with pytest.raises(BimanualError, match="from 0 to 2"):
            parse_episodes(text, 3)
