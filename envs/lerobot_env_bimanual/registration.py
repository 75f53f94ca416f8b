"""Gymnasium ids of the tasks, e.g. `bimanual/LiftBall-v0`."""

import gymnasium as gym

from lerobot_env_bimanual.tasks.discovery import task_modules

NAMESPACE = "bimanual"
VERSION = 0


def gym_id(task: str) -> str:
    """Id of a task, e.g. `bimanual/LiftBall-v0` of `lift_ball`."""
    return f"{NAMESPACE}/{''.join(word.capitalize() for word in task.split('_'))}-v{VERSION}"


def register_gym_ids() -> None:
    """Register every task, without importing it: a task is named like its module, and MuJoCo stays unloaded."""
    for task in sorted(task_modules()):
        if gym_id(task) not in gym.registry:
            gym.register(
                gym_id(task), entry_point="lerobot_env_bimanual.env:BimanualEnv", kwargs={"task": task}
            )
