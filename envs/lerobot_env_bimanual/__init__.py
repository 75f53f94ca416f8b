"""Thirteen bimanual tasks in MuJoCo as a Gymnasium and LeRobot environment.

Importing this package registers the Gymnasium ids `bimanual/PushBox-v0`, ... and nothing heavier than Gymnasium.
LeRobot's plugin discovery imports it too, always from inside LeRobot, and then the environment type `bimanual`
is registered as well. Without LeRobot in the process it is left out, so that worker processes of vector
environments, which import this package to build their environment, start without LeRobot and torch. To use the
type in a script that imports this package before LeRobot, import `BimanualEnvConfig` from here.
"""

import sys
from typing import TYPE_CHECKING, Any

from lerobot_env_bimanual.tasks.registry import register_gym_ids

if TYPE_CHECKING or "lerobot" in sys.modules:
    from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig

__all__ = ["BimanualEnvConfig"]

register_gym_ids()


def __getattr__(name: str) -> Any:
    """Import the configuration on first use where LeRobot was not loaded before."""
    if name != "BimanualEnvConfig":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{name} is an environment of LeRobot: pip install 'lerobot_env_bimanual[lerobot]'. Without LeRobot there is "
            "gymnasium.make('bimanual/LiftBall-v0')"
        ) from error

    return BimanualEnvConfig
