"""Keypose policies for two arms, as LeRobot policies.

LeRobot's plugin discovery imports this package, always from inside LeRobot, and then the configs are registered;
networks are imported when a policy is made. Without LeRobot in the process they are left out, so that the help
texts of the package's commands need neither LeRobot nor torch. To use a policy in a script that imports this package
before LeRobot, import its config from here.
"""

import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING or "lerobot" in sys.modules:
    from lerobot_policy_bimanual.configurations import (
        PerAct2Config,
        PerActIndependentConfig,
        PerActLFConfig,
        RVTLFConfig,
    )

__all__ = ["PerAct2Config", "PerActIndependentConfig", "PerActLFConfig", "RVTLFConfig"]


def __getattr__(name: str) -> Any:
    """Import the configs on first use where LeRobot was not loaded before."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from lerobot_policy_bimanual import configurations

    return getattr(configurations, name)
