"""PerAct2: a Perceiver-Actor for two arms.

Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278).
"""

from typing import Any

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec_torch import DiscreteKeypose
from lerobot_policy_bimanual.keypose_policy import KeyposePolicy
from lerobot_policy_bimanual.nn.peract import PerActNetwork
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.nn.voxel_grid import voxelise
from lerobot_policy_bimanual.peract2.configuration_peract2 import PerAct2Config
from lerobot_policy_bimanual.processing import PROPRIO_PER_ARM, Observation


class PerAct2Policy(KeyposePolicy):
    """Voxels in, the next keypose of both arms out, from one network."""

    config: PerAct2Config  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerAct2Config  # pyright: ignore[reportAssignmentType]
    name = "peract2"  # pyright: ignore[reportAssignmentType]

    def __init__(self, config: PerAct2Config, **kwargs: Any):
        super().__init__(config, **kwargs)
        self.network = PerActNetwork(
            arms=len(ARMS),
            voxels=config.voxel_size,
            channels=config.channels,
            token_dim=config.token_dim,
            proprio_dim=len(ARMS) * PROPRIO_PER_ARM,
            language_tokens=config.language_tokens,
            language_dim=config.language_dim,
            num_latents=config.num_latents,
            latent_dim=config.latent_dim,
            depth=config.depth,
            heads=config.heads,
            feedforward_multiplier=config.feedforward_multiplier,
            attention_dropout=config.attention_dropout,
            rotation_bins=self.codec.rotation_bins,
            translation_head=config.translation_head,
            checkpointing=config.activation_checkpointing,
        )
        if config.compile:
            self.network.compile()  # in place: the names in the checkpoint stay the same

    def predict(self, observation: Observation, target: DiscreteKeypose | None) -> KeyposePrediction:
        """Voxelise the cloud and run the network."""
        grid = voxelise(
            observation.points,
            observation.colours,
            workspace=self.config.workspace,
            voxels=self.config.voxel_size,
        )
        return self.network(
            grid,
            observation.proprio,
            self.language(observation.instructions),
            None if target is None else target.voxel,
        )
