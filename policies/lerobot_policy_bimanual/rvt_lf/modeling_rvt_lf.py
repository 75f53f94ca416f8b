"""RVT-LF: a leading and a following Robotic View Transformer.

A baseline of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278), made of RVT (Goyal et al., 2023, https://arxiv.org/abs/2306.14896).
"""

from functools import partial

from torch import Tensor

from lerobot_bimanual.arms import Arm
from lerobot_policy_bimanual.keypose.observation import PROPRIO_PER_ARM, Observation
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.nn.arms import LeaderFollower
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig
from lerobot_policy_bimanual.rvt_lf.network import RVTNetwork
from lerobot_policy_bimanual.rvt_lf.point_renderer import render_views
from lerobot_policy_bimanual.rvt_lf.views import with_goal


class RVTLFPolicy(KeyposePolicy):
    """Rendered views in, the leader's next keypose out, then the follower's given the leader's."""

    config: RVTLFConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = RVTLFConfig  # pyright: ignore[reportAssignmentType]
    name = "rvt_lf"  # pyright: ignore[reportAssignmentType]

    def make_network(self) -> LeaderFollower:
        """One network per arm, the follower's with a longer proprioception."""
        return LeaderFollower(
            partial(RVTNetwork, self.config),
            proprio_dim=PROPRIO_PER_ARM,
            leader=Arm(self.config.leader),
            codec=self.codec,
            mark=with_goal if self.config.follower_sees_goal else None,
        )

    def scene(self, observation: Observation) -> Tensor:
        """Five views (b, 5, 10, size, size) of the cloud, the same for both arms."""
        return render_views(
            observation.points,
            observation.colours,
            workspace=self.config.workspace,
            size=self.config.voxel_size,
            radius=self.config.point_radius,
        )
