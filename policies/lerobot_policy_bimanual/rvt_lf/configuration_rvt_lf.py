"""Config of RVT-LF."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_bimanual.arms import ARMS
from lerobot_policy_bimanual.keypose.fields import choice
from lerobot_policy_bimanual.rvt.config import RVTConfig


@PreTrainedConfig.register_subclass("rvt_lf")
@dataclass
class RVTLFConfig(RVTConfig):
    """RVT-LF: one five-view RVT per arm, the follower's being told the leader's next keypose."""

    leader: str = choice("right", ARMS)  # the arm that decides first, `left` or `right` (the paper's)
