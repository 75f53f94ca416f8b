"""What the PerAct variants have in common: voxels in, one or two PerAct networks."""

from torch import nn

from lerobot_bimanual.codec_torch import DiscreteKeypose
from lerobot_policy_bimanual.keypose_policy import KeyposePolicy
from lerobot_policy_bimanual.nn.peract import PerActNetwork
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.nn.voxel_grid import voxelise
from lerobot_policy_bimanual.peract_config import PerActConfig
from lerobot_policy_bimanual.processing import Observation


class PerActPolicy(KeyposePolicy):
    """Voxelises the cloud for `network`, which a subclass makes out of PerAct networks.

    `network` is called as `network(grid, proprio, language, target)` and predicts both arms.
    """

    config: PerActConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    network: nn.Module

    def predict(self, observation: Observation, target: DiscreteKeypose | None) -> KeyposePrediction:
        """Voxelise the cloud and run the network."""
        grid = voxelise(
            observation.points,
            observation.colours,
            workspace=self.config.workspace,
            voxels=self.config.voxel_size,
        )
        return self.network(grid, observation.proprio, self.language(observation.instructions), target)


def make_network(config: PerActConfig, *, arms: int, proprio_dim: int) -> PerActNetwork:
    """A PerAct network of the config's size for one arm or both."""
    network = PerActNetwork(
        arms=arms,
        voxels=config.voxel_size,
        channels=config.channels,
        token_dim=config.token_dim,
        proprio_dim=proprio_dim,
        language_tokens=config.language_tokens,
        language_dim=config.language_dim,
        num_latents=config.num_latents,
        latent_dim=config.latent_dim,
        depth=config.depth,
        heads=config.heads,
        feedforward_multiplier=config.feedforward_multiplier,
        attention_dropout=config.attention_dropout,
        rotation_bins=config.codec.rotation_bins,
        translation_head=config.translation_head,
        voxel_cells=config.voxel_cells,
        projection_dilations=config.projection_dilations,
        checkpointing=config.activation_checkpointing,
    )
    if config.compile:
        network.compile()  # in place: the names in the checkpoint stay the same
    return network
