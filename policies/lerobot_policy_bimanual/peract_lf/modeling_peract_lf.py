"""PerAct-LF: a leading and a following Perceiver-Actor.

A baseline of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278), made of PerAct (Shridhar et al., 2022, https://arxiv.org/abs/2209.05451).
"""

from functools import partial

from lerobot_bimanual.arms import Arm
from lerobot_policy_bimanual.keypose.observation import PROPRIO_PER_ARM
from lerobot_policy_bimanual.nn.arms import LeaderFollower
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.policy import PerActPolicy
from lerobot_policy_bimanual.peract.voxel_grid import with_goal
from lerobot_policy_bimanual.peract_lf.configuration_peract_lf import PerActLFConfig


class PerActLFPolicy(PerActPolicy):
    """Voxels in, the leader's next keypose out, then the follower's given the leader's."""

    config: PerActLFConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerActLFConfig  # pyright: ignore[reportAssignmentType]
    name = "peract_lf"  # pyright: ignore[reportAssignmentType]

    def make_network(self) -> LeaderFollower:
        """One network per arm, the follower's with a longer proprioception."""
        return LeaderFollower(
            partial(PerActNetwork, self.config, arms=1),
            proprio_dim=PROPRIO_PER_ARM,
            leader=Arm(self.config.leader),
            codec=self.codec,
            mark=with_goal if self.config.follower_sees_goal else None,
        )
