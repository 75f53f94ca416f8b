"""Config of independent PerAct."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_policy_bimanual.peract.config import PerActConfig


@PreTrainedConfig.register_subclass("peract_independent")
@dataclass
class PerActIndependentConfig(PerActConfig):
    """Independent PerAct: one PerAct per arm, and neither knows what the other is going to do."""
