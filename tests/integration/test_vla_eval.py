"""vla-eval's client plays the tasks of its example, and LeRobot's loader makes environments of the EnvHub example."""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from lerobot.envs.configs import HubEnvConfig
from lerobot.envs.factory import make_env
from planted_failures import expert_keyposes
from vla_eval.api import evaluate
from vla_eval.model_servers.base import ModelServer
from vla_eval.registry import resolve_import_string

from lerobot_env_bimanual.tasks.registry import list_tasks

EXAMPLE = Path(__file__).parents[2] / "examples/13_vla_eval"


class Server(ModelServer):
    """Answers every observation with the next action of a list."""

    def __init__(self, actions: list[np.ndarray], benchmark: Any):
        self.actions, self.benchmark = actions, benchmark
        self.left: Iterator[np.ndarray] = iter(())

    async def on_episode_start(self, config: dict[str, Any], ctx: Any) -> None:
        self.left = iter(self.actions)

    async def on_observation(self, obs: dict[str, Any], ctx: Any) -> None:
        assert obs["images"]["left_wrist"].shape == (24, 32, 3)
        await ctx.send_action({"actions": next(self.left)})

    def get_action_spec(self) -> dict[str, Any]:
        return self.benchmark.get_action_spec()

    def get_observation_spec(self) -> dict[str, Any]:
        return self.benchmark.get_observation_spec()


def test_the_harness_solves_a_task_with_the_experts_keyposes_and_not_with_invalid_actions(
    tmp_path, monkeypatch
):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    config = yaml.safe_load((EXAMPLE / "bimanual.yaml").read_text())
    options = {"control_mode": "keypose", "obs": "rgb", "cameras": "front,left_wrist", "image_size": "24x32"}
    params = {"tasks": "lift_ball", "seed": 3, "options": options}
    benchmark = resolve_import_string(config["benchmarks"][0]["benchmark"])(**params)
    assert sum(spec.dims for spec in benchmark.get_action_spec().values()) == 18
    overrides = {"episodes_per_task": 1, "params": params}
    nonsense = [([np.full(18, np.nan)], 0.0), ([np.zeros(3)], 0.0)]
    for actions, rate in ((expert_keyposes("lift_ball", seed=3), 1.0), *nonsense):
        server = Server(actions, benchmark)
        (result,) = evaluate(server, config, output_dir=tmp_path, benchmark_overrides=overrides, no_save=True)
        assert [task["mean_success"] for task in result["tasks"]] == [rate]
    sys.modules.pop("bimanual_benchmark", None)


ENV_PY = Path(__file__).parents[2] / "examples/12_envhub/env.py"
COMMIT = 40 * "a"


def test_lerobot_makes_every_task_or_the_chosen_ones_with_the_options_of_the_repository(tmp_path):
    place = (
        tmp_path / "models--someone--bimanual/snapshots" / COMMIT
    )  # as the Hub's library stores a repository
    place.mkdir(parents=True)
    shutil.copy(ENV_PY, place)
    downloaded: Any = {"hub_cache_dir": str(tmp_path), "trust_remote_code": True, "use_async_envs": False}
    envs = make_env(f"someone/bimanual@{COMMIT}", n_envs=2, **downloaded)
    assert {suite: len(numbered) for suite, numbered in envs.items()} == {"all": len(list_tasks())}
    env = envs["all"][0]
    assert env.num_envs == 2
    assert env.single_observation_space["pixels"]["front"].shape == (128, 128, 3)
    config = HubEnvConfig(task="lift_ball,push_box", hub_path=f"someone/bimanual@{COMMIT}")
    assert set(make_env(config, n_envs=1, **downloaded)) == {"lift_ball", "push_box"}
