"""Config of PerAct-LF."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_policy_bimanual.keypose.fields import choice, number
from lerobot_policy_bimanual.peract.config import PerActConfig


@PreTrainedConfig.register_subclass("peract_lf")
@dataclass
class PerActLFConfig(PerActConfig):
    """PerAct-LF: one PerAct per arm, the follower's being told the leader's next keypose."""

    leader: str = choice("right", "left")  # the arm that decides first, `left` or `right` (the paper's)
    # The follower sees the leader's goal, as one more channel of its grid; in the paper it has its numbers only.
    follower_sees_goal: bool = False
    # Standard deviation in metres, along each axis, of random shifts of half of the leader's places in training, so that the
    # follower does not trust a wrong prediction blindly. The paper's follower is told true places alone.
    leader_noise_m: float = number(0.0, 0, 1)
