"""Datasets of policies' episodes: replayed exactly, of both views, with what became of each."""

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from planted_failures import evaluation, expert_keyposes, played

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode

pytestmark = pytest.mark.weekly


def states_played_again(dataset: RecordedDataset, index: int) -> list[int]:
    """The state after every action of an episode of `frames`, as datasets store it."""
    meta, columns = (episode := dataset.episode(index)).meta, episode.columns
    env = BimanualEnv(meta.task, split=meta.split, obs="state")
    env.reset(seed=meta.seed, options={"variation": meta.variation})
    return [schema.state_hash_column(env.state_hash()) for each in columns[schema.ACTION] if env.step(each)]


def test_a_dataset_of_a_record_has_its_states_actions_and_outcomes(tmp_path, capsys):
    env, joint_actions = BimanualEnv("lift_ball", obs="state"), []
    with env.observed_by(lambda _, action: joint_actions.append(action.copy())):
        run_episode(env, 4, expert())
    impossible = np.zeros(18)
    stopped = [expert_keyposes("lift_ball", seed=5)[0], impossible]
    actions = (expert_keyposes("lift_ball", seed=3), joint_actions, stopped, [impossible])
    episodes = [played("lift_ball", each, seed) for seed, each in enumerate(actions, 3)]
    assert [episode.success for episode in episodes] == [True, True, False, False]
    records = tmp_path / "lift_ball_test_record.json"
    options = {"split": "test", "image_size": 24, "cameras": "front,left_wrist"}
    evaluation("lift_ball", options, *episodes).write(records)
    root = tmp_path / "played"
    words = ["dataset", "from-results", f"--results={records}", "--workers=1"]
    assert main([*words, f"--root={root}"]) == 0
    assert "left out: lift_ball, seed 6: no tick was played" in capsys.readouterr().out
    for view in schema.VIEWS:
        dataset = RecordedDataset(root / view)
        assert (dataset.view, dataset.cameras) == (view, ("front", "left_wrist"))
        assert [dataset.episode(index).meta.seed for index in range(len(dataset))] == [3, 4, 5]
        rows = LeRobotDataset("local/played", root=root / view)
        last = [rows[end - 1] for end in rows.meta.episodes["dataset_to_index"]]
        assert [bool(row[feature_table.SUCCESS]) for row in last] == [True, True, False]
        assert [row[feature_table.FAILURE_CLASS] for row in last] == ["", "", "unreachable"]
        assert {(row["policy"], row["setting"], row["perturb"]) for row in last} == {
            ("lift_ball_test_record", "standard", "")
        }
    frames = RecordedDataset(root / "frames")
    assert [len(episode) for episode in frames.episodes()] == [each.ticks for each in episodes[:3]]
    for episode in frames.episodes():
        assert states_played_again(frames, episode.index) == episode.columns[schema.STATE_HASH].tolist()
    # The poses that discovery finds in joint actions are where keyposes lead.
    reached = RecordedDataset(root / "keyframes").episode(1).columns
    columns = (reached[schema.EE_POSE][1:], reached[schema.ACTION][:-1])
    given, found = (column.reshape(len(column), 2, -1)[:, :, :3] for column in columns)
    assert np.abs(given - found).max() < 0.02
    assert reached[schema.KEYPOSE_STEP].ravel().tolist() == [*range(len(given) + 1)]
    assert main(["dataset", "verify", f"--root={root}", "--workers=1"]) == 3

    (tmp_path / "link").symlink_to(tmp_path / "failed")
    assert main([*words, f"--root={tmp_path / 'link'}", "--outcome=failed", "--view=keyframes"]) == 0
    assert len(RecordedDataset(tmp_path / "failed")) == 1
    assert main([*words, f"--root={root}"]) == 1
