"""What the PerAct variants have in common in their configs."""

from dataclasses import dataclass

from lerobot_bimanual.errors import InvalidChoice
from lerobot_policy_bimanual.keypose_config import KeyposePolicyConfig

TRANSLATION_HEADS = ("dense", "factorised")
PATCH = 5


@dataclass
class PerActConfig(KeyposePolicyConfig):
    """Base config of the PerAct variants; the defaults are the paper's network.

    `docs/policies.md` has the flags of a small one that trains in minutes on a laptop's CPU.

    Args:
        channels: Voxel feature channels.
        token_dim: Width of the Perceiver's input tokens, half voxels and half proprioception.
        num_latents: Perceiver latents per network, shared evenly by the arms that it predicts.
        latent_dim: Width of the latents.
        depth: Self-attention blocks per arm.
        heads: Heads of the self-attentions.
        feedforward_multiplier: Inner over outer width of the feed-forwards.
        attention_dropout: Dropout of attention weights.
        translation_head: "dense", the paper's softmax over all voxels, or "factorised", the same distribution
            as patch times voxel in patch, several times cheaper.
        voxel_cells: With the factorised head, cells into which each axis of a voxel is cut, so that
            `decode=expectation` answers finer than a voxel; 0 for none (departure from the paper otherwise).
        projection_dilations: With the factorised head, dilations of further convolutions over what lies in line
            with a voxel along each axis, so that it sees that many voxels further to every side. Places in the air,
            far from all things, want [3,9] at 25 voxels; none for one voxel (departure from the paper otherwise).
        activation_checkpointing: Recompute the dense head in the backward pass: less memory, more time.
    """

    channels: int = 64
    token_dim: int = 128
    num_latents: int = 2048
    latent_dim: int = 512
    depth: int = 6
    heads: int = 8
    feedforward_multiplier: int = 4
    attention_dropout: float = 0.1
    translation_head: str = "dense"
    voxel_cells: int = 0
    projection_dilations: tuple[int, ...] = ()
    activation_checkpointing: bool = False

    def __post_init__(self):
        """Refuse sizes that do not fit together."""
        super().__post_init__()
        if self.translation_head not in TRANSLATION_HEADS:
            raise InvalidChoice("translation_head", self.translation_head, TRANSLATION_HEADS)
        if self.voxel_cells and (self.voxel_cells < 2 or self.translation_head == "dense"):
            raise ValueError(
                f"voxel_cells={self.voxel_cells} must be 0, or at least 2 with translation_head=factorised"
            )
        if self.projection_dilations and (
            min(self.projection_dilations) < 1 or self.translation_head == "dense"
        ):
            raise ValueError(
                f"projection_dilations={list(self.projection_dilations)} must be [], or numbers of voxels "
                "from 1 with translation_head=factorised"
            )
        self._require_multiple("voxel_size", PATCH, "a patch is five voxels wide")
        self._require_multiple("token_dim", 2, "half of a token is proprioception")
        self._require_multiple("latent_dim", self.heads, "the heads share the latent evenly")

    def _require_multiple(self, option: str, divisor: int, why: str) -> None:
        value = getattr(self, option)
        if value < divisor or value % divisor:
            raise ValueError(f"{option}={value} must be a multiple of {divisor}: {why}")
