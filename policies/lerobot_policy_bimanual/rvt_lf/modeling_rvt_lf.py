"""RVT-LF: a leading and a following Robotic View Transformer.

A baseline of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278), made of RVT (Goyal et al., 2023, https://arxiv.org/abs/2306.14896).
"""

from functools import partial

from lerobot_bimanual.arms import Arm
from lerobot_policy_bimanual.keypose.observation import PROPRIO_PER_ARM, Observation
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.nn.arms import LeaderFollower
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig
from lerobot_policy_bimanual.rvt_lf.scene import Scene
from lerobot_policy_bimanual.rvt_lf.two_stages import StagedRVT


class RVTLFPolicy(KeyposePolicy):
    """Rendered views in, the leader's next keypose out, then the follower's given the leader's."""

    config: RVTLFConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = RVTLFConfig  # pyright: ignore[reportAssignmentType]
    name = "rvt_lf"  # pyright: ignore[reportAssignmentType]

    def make_network(self) -> LeaderFollower:
        """One network per arm, the follower's with a longer proprioception."""
        return LeaderFollower(
            partial(StagedRVT, self.config),
            proprio_dim=PROPRIO_PER_ARM,
            leader=Arm(self.config.leader),
            codec=self.codec,
            mark=Scene.with_goal if self.config.follower_sees_goal else None,
        )

    def scene(self, observation: Observation) -> Scene:
        """The cloud and its five views, the same for both arms."""
        return Scene.of(observation, self.config)
