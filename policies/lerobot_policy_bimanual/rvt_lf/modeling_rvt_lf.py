"""RVT-LF: a leading and a following Robotic View Transformer.

A baseline of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278), made of RVT (Goyal et al., 2023, https://arxiv.org/abs/2306.14896).
"""

from typing import Any

from torch import nn

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.codec_torch import DiscreteKeypose
from lerobot_policy_bimanual.keypose_policy import KeyposePolicy
from lerobot_policy_bimanual.nn.leader_follower import LeaderFollower
from lerobot_policy_bimanual.nn.point_renderer import render_views
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.nn.rvt import RVTNetwork
from lerobot_policy_bimanual.processing import PROPRIO_PER_ARM, Observation
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig


class RVTLFPolicy(KeyposePolicy):
    """Rendered views in, the leader's next keypose out, then the follower's given the leader's."""

    config: RVTLFConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = RVTLFConfig  # pyright: ignore[reportAssignmentType]
    name = "rvt_lf"  # pyright: ignore[reportAssignmentType]

    def __init__(self, config: RVTLFConfig, **kwargs: Any):
        super().__init__(config, **kwargs)
        self.network = LeaderFollower(
            lambda proprio_dim: make_network(config, proprio_dim),
            proprio_dim=PROPRIO_PER_ARM,
            leader=Arm(config.leader),
            codec=self.codec,
        )

    def predict(self, observation: Observation, target: DiscreteKeypose | None) -> KeyposePrediction:
        """Render the cloud once for both arms and run the networks."""
        views = render_views(
            observation.points,
            observation.colours,
            workspace=self.config.workspace,
            size=self.config.voxel_size,
            radius=self.config.point_radius,
        )
        return self.network(views, observation.proprio, self.language(observation.instructions), target)


def make_network(config: RVTLFConfig, proprio_dim: int) -> nn.Module:
    """An RVT of the config's size for one arm."""
    network = RVTNetwork(
        size=config.voxel_size,
        patch=config.patch,
        channels=config.channels,
        token_dim=config.token_dim,
        attention_dim=config.attention_dim,
        depth=config.depth,
        heads=config.heads,
        feedforward_multiplier=config.feedforward_multiplier,
        attention_dropout=config.attention_dropout,
        proprio_dim=proprio_dim,
        language_dim=config.language_dim,
        rotation_bins=config.codec.rotation_bins,
        heatmap_sigma_px=config.heatmap_sigma_px,
    )
    if config.compile:
        network.compile()  # in place: the names in the checkpoint stay the same
    return network
