"""Keypose policies for two arms, as LeRobot policies: for each its config and the policy.

LeRobot's plugin discovery imports this package, always from inside LeRobot. This registers the configs; policies are
imported on first use. If LeRobot is not loaded, even the configs are not imported, so that the help texts of the
package's commands need neither LeRobot nor torch. To use a policy in a script that imports this package before LeRobot,
import its config from here.
"""

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING or "lerobot" in sys.modules:
    from lerobot_policy_bimanual.configurations import (
        PerAct2Config,
        PerActIndependentConfig,
        PerActLFConfig,
        RVTLFConfig,
    )

__all__ = [
    "PerAct2Config",
    "PerAct2Policy",
    "PerActIndependentConfig",
    "PerActIndependentPolicy",
    "PerActLFConfig",
    "PerActLFPolicy",
    "RVTLFConfig",
    "RVTLFPolicy",
]

_CLASSES = {
    "peract2": "PerAct2",
    "peract_independent": "PerActIndependent",
    "peract_lf": "PerActLF",
    "rvt_lf": "RVTLF",
}


def __dir__() -> list[str]:
    """What can be imported from here."""
    return __all__


def __getattr__(name: str) -> Any:
    """Import a config or a policy on first use."""
    for policy, begin in _CLASSES.items():
        kinds = {f"{begin}Config": "configuration", f"{begin}Policy": "modeling"}
        if kind := kinds.get(name):
            importlib.import_module(f"{__name__}.configurations")
            return getattr(importlib.import_module(f"{__name__}.{policy}.{kind}_{policy}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
