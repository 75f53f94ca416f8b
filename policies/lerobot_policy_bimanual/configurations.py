"""The configs of all policies; importing this module registers them and their optimizers with LeRobot."""

from lerobot_policy_bimanual.peract2.configuration_peract2 import PerAct2Config
from lerobot_policy_bimanual.peract_independent.configuration_peract_independent import (
    PerActIndependentConfig,
)
from lerobot_policy_bimanual.peract_lf.configuration_peract_lf import PerActLFConfig
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig

__all__ = ["PerAct2Config", "PerActIndependentConfig", "PerActLFConfig", "RVTLFConfig"]
