"""LeRobot's own loader makes environments of the EnvHub example."""

from pathlib import Path

from lerobot.envs.configs import HubEnvConfig
from lerobot.envs.utils import _call_make_env, _import_hub_module, _normalize_hub_result

from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

ENV_PY = Path(__file__).parents[2] / "examples/12_envhub/env.py"


def test_lerobot_makes_every_task_or_the_chosen_ones_with_the_options_of_the_repository():
    module = _import_hub_module(str(ENV_PY), "someone/bimanual")
    envs = _normalize_hub_result(_call_make_env(module, n_envs=2, use_async_envs=False, cfg=None))
    assert {task: list(numbered) for task, numbered in envs.items()} == {
        task: [get_task(task).spec.id] for task in list_tasks()
    }
    (env,) = envs["lift_ball"].values()
    assert env.num_envs == 2
    assert env.single_observation_space["pixels"]["front"].shape == (128, 128, 3)
    config = HubEnvConfig(task="lift_ball,push_box")
    chosen = _normalize_hub_result(_call_make_env(module, n_envs=1, use_async_envs=False, cfg=config))
    assert set(chosen) == {"lift_ball", "push_box"}
