"""Config of PerAct-LF."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.errors import InvalidChoice
from lerobot_policy_bimanual.peract_config import PerActConfig


@PreTrainedConfig.register_subclass("peract_lf")
@dataclass
class PerActLFConfig(PerActConfig):
    """PerAct-LF: one PerAct per arm, the follower's being told the leader's next keypose.

    Args:
        leader: The arm that decides first, "left" or "right" (the paper's).
    """

    leader: str = "right"

    def __post_init__(self):
        """Refuse a leader that is no arm."""
        super().__post_init__()
        if self.leader not in ARMS:
            raise InvalidChoice("leader", self.leader, ARMS)
