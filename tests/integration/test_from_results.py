"""Datasets of policies' episodes: replayed exactly, of both views, with what became of each."""

from functools import partial

import numpy as np
import pytest
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from lerobot_bimanual.cli import main
from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv

pytestmark = pytest.mark.weekly


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Four episodes: solved by keyposes, the first of them again by joint actions, failed, and without a tick."""
    folder = tmp_path_factory.mktemp("records")
    seen = {"image_size": 24, "cameras": "front,left_wrist"}
    make = partial(BimanualEnv, "lift_ball", obs="state", **seen)
    envs = LazyVectorEnv([make], asynchronous=False, results_dir=str(folder))
    (env,) = envs._ensure().envs
    joint_actions = []
    for seed, end in ((3, None), (4, "joint"), (5, "stop"), (6, "at once")):
        envs.reset(seed=[seed])
        bare = env.unwrapped
        if end == "joint":
            other = BimanualEnv("lift_ball", obs="state")
            other.reset(seed=seed)
            with other.observed_by(lambda _, action: joint_actions.append(action.copy())):
                for move in expert()(other):
                    if other.step(move.action)[2]:
                        break
            for action in joint_actions:
                envs.step(action[None])
            continue
        for number, move in enumerate(expert()(bare)):
            bad = end == "at once" or (end == "stop" and number == 1)
            over = envs.step(np.zeros((1, 18)) if bad else move.action[None])[2].any()
            if over:
                break
    envs.close()
    return folder / "lift_ball_test_record.json"


def test_a_dataset_of_a_record_has_its_states_actions_and_outcomes(records, played_again, tmp_path, capsys):
    played = EvaluationRecord.read(records).episodes
    assert [episode.success for episode in played] == [True, True, False, False]
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
    frames = RecordedDataset(root / "frames")
    assert [played_again(frames, index) for index in range(3)] == [each.ticks for each in played[:3]]
    # The poses that discovery finds in joint actions are where keyposes lead.
    reached = RecordedDataset(root / "keyframes").episode(1).columns
    columns = (reached[schema.EE_POSE][1:], reached[schema.ACTION][:-1])
    given, found = (column.reshape(len(column), 2, -1)[:, :, :3] for column in columns)
    assert np.abs(given - found).max() < 0.02
    assert reached[schema.KEYPOSE_STEP].ravel().tolist() == [*range(len(given) + 1)]
    assert main(["dataset", "verify", f"--root={root}", "--workers=1"]) == 3

    assert main([*words, f"--root={tmp_path / 'failed'}", "--outcome=failed", "--view=keyframes"]) == 0
    assert len(RecordedDataset(tmp_path / "failed")) == 1
    assert main([*words, f"--root={root}"]) == 1
