"""Thirteen bimanual tasks in MuJoCo as a Gymnasium and LeRobot environment.

Importing this package registers the Gymnasium ids `bimanual/PushBox-v0`, ... and imports nothing heavier than Gymnasium;
the names in `__all__` are imported when they are first used. If LeRobot is in the process, as when its plugin discovery
imports this package, the environment type `bimanual` is registered as well. Otherwise it is not, so that worker processes
of vector environments, which import this package to build their environment, start without LeRobot and torch. To use the
type in a script that imports this package before LeRobot, import `BimanualEnvConfig` from here.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

from lerobot_env_bimanual.tasks.registry import list_tasks, register_gym_ids

if TYPE_CHECKING or "lerobot" in sys.modules:
    from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig
if TYPE_CHECKING:
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.experts.runner import play_expert
    from lerobot_env_bimanual.vector.gym_env import make_env
    from lerobot_env_bimanual.vector.policy_evaluation import evaluate

__all__ = ["BimanualEnv", "BimanualEnvConfig", "evaluate", "list_tasks", "make_env", "play_expert"]

_MODULES = {
    "BimanualEnv": "env",
    "BimanualEnvConfig": "configuration_bimanual",
    "evaluate": "vector.policy_evaluation",
    "make_env": "vector.gym_env",
    "play_expert": "experts.runner",
}
"""Where each name is defined."""

register_gym_ids()


def __dir__() -> list[str]:
    """What can be imported from here."""
    return __all__


def __getattr__(name: str) -> Any:
    """Import a name's module on first use."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    except ModuleNotFoundError as error:
        if name != "BimanualEnvConfig":
            raise
        raise ModuleNotFoundError(
            f"{name} is an environment of LeRobot: pip install 'lerobot_env_bimanual[lerobot]'. Without LeRobot there is "
            "gymnasium.make('bimanual/LiftBall-v0')"
        ) from error
