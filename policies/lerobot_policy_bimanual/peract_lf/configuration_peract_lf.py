"""Config of PerAct-LF."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_policy_bimanual.keypose.fields import choice
from lerobot_policy_bimanual.peract.config import PerActConfig


@PreTrainedConfig.register_subclass("peract_lf")
@dataclass
class PerActLFConfig(PerActConfig):
    """PerAct-LF: one PerAct per arm, the follower's being told the leader's next keypose."""

    leader: str = choice("right", "left")  # the arm that decides first, `left` or `right` (the paper's)
    # The follower sees the leader's goal, as one more channel of its grid; in the paper it has its numbers only.
    follower_sees_goal: bool = False
