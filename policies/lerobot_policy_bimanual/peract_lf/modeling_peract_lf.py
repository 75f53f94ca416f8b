"""PerAct-LF: a leading and a following Perceiver-Actor.

A baseline of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278), made of PerAct (Shridhar et al., 2022, https://arxiv.org/abs/2209.05451).
"""

from typing import Any

from lerobot_bimanual.arms import Arm
from lerobot_policy_bimanual.nn.leader_follower import LeaderFollower
from lerobot_policy_bimanual.peract_lf.configuration_peract_lf import PerActLFConfig
from lerobot_policy_bimanual.peract_policy import PerActPolicy, make_network
from lerobot_policy_bimanual.processing import PROPRIO_PER_ARM


class PerActLFPolicy(PerActPolicy):
    """Voxels in, the leader's next keypose out, then the follower's given the leader's."""

    config: PerActLFConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerActLFConfig  # pyright: ignore[reportAssignmentType]
    name = "peract_lf"  # pyright: ignore[reportAssignmentType]

    def __init__(self, config: PerActLFConfig, **kwargs: Any):
        super().__init__(config, **kwargs)
        self.network = LeaderFollower(
            lambda proprio_dim: make_network(config, arms=1, proprio_dim=proprio_dim),
            proprio_dim=PROPRIO_PER_ARM,
            leader=Arm(config.leader),
            codec=self.codec,
        )
