"""LeRobot's own loader makes environments of the EnvHub example."""

import shutil
from pathlib import Path

import pytest
from lerobot.envs.configs import HubEnvConfig
from lerobot.envs.factory import make_env

from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

ENV_PY = Path(__file__).parents[2] / "examples/12_envhub/env.py"
COMMIT = 40 * "a"


@pytest.fixture
def downloaded(tmp_path) -> dict:
    """Arguments with which LeRobot finds the repository `someone/bimanual` as the Hub's library stores it."""
    place = tmp_path / "models--someone--bimanual/snapshots" / COMMIT
    place.mkdir(parents=True)
    shutil.copy(ENV_PY, place)
    return {"hub_cache_dir": str(tmp_path), "trust_remote_code": True, "use_async_envs": False}


def test_lerobot_makes_every_task_or_the_chosen_ones_with_the_options_of_the_repository(downloaded):
    envs = make_env(f"someone/bimanual@{COMMIT}", n_envs=2, **downloaded)
    assert {suite: list(numbered) for suite, numbered in envs.items()} == {
        "all": [get_task(task).spec.id for task in list_tasks()]
    }
    env = envs["all"][get_task("lift_ball").spec.id]
    assert env.num_envs == 2
    assert env.single_observation_space["pixels"]["front"].shape == (128, 128, 3)
    config = HubEnvConfig(task="lift_ball,push_box", hub_path=f"someone/bimanual@{COMMIT}")
    assert set(make_env(config, n_envs=1, **downloaded)) == {"lift_ball", "push_box"}
