"""Gymnasium ids of the tasks, e.g. `bimanual/LiftBall-v0`."""

from pathlib import Path

import gymnasium as gym

NAMESPACE = "bimanual"
VERSION = 0


def gym_id(task: str) -> str:
    """Id of a task, e.g. `bimanual/LiftBall-v0` of `lift_ball`."""
    return f"{NAMESPACE}/{''.join(word.capitalize() for word in task.split('_'))}-v{VERSION}"


def register_gym_ids() -> None:
    """Register every task, without importing it: a task is named like its module, and MuJoCo stays unloaded."""
    for module in sorted((Path(__file__).parent / "tasks").glob("[!_]*.py")):
        if gym_id(module.stem) not in gym.registry:
            gym.register(
                gym_id(module.stem),
                entry_point="lerobot_env_bimanual.env:BimanualEnv",
                kwargs={"task": module.stem},
            )
