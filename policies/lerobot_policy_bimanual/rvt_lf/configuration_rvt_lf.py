"""Config of RVT-LF."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.errors import InvalidChoice
from lerobot_policy_bimanual.keypose_config import KeyposePolicyConfig


@PreTrainedConfig.register_subclass("rvt_lf")
@dataclass
class RVTLFConfig(KeyposePolicyConfig):
    """RVT-LF: one five-view RVT per arm, the follower's being told the leader's next keypose.

    The defaults are the networks of PerAct2's baseline. The recipe `small` of `lerobot-bimanual benchmark` has the
    flags of networks that train on a laptop's CPU.

    Args:
        voxel_size: Pixels per side of every view, and so the voxels per axis from which positions are chosen
            (RVT code: 220 of both).
        leader: The arm that decides first, "left" or "right" (the paper's).
        patch: Pixels per side of a patch; odd, so that kernels of this width have a centre.
        point_radius: Radius of a rendered point in units of the workspace's half edge.
        channels: Pixel feature channels.
        token_dim: Width of the image tokens outside the attention, half pixels and half proprioception.
        attention_dim: Width of the tokens within it.
        depth: Attention blocks; the first half within each view, the second half over all of them.
        heads: Heads of the attentions.
        feedforward_multiplier: Inner over outer width of the feed-forwards.
        attention_dropout: Dropout of attention weights.
        heatmap_sigma_px: Standard deviation of the Gaussian that a heatmap is trained towards.
    """

    voxel_size: int = 220
    leader: str = "right"
    patch: int = 11
    point_radius: float = 0.012
    channels: int = 64
    token_dim: int = 128
    attention_dim: int = 512
    depth: int = 8
    heads: int = 8
    feedforward_multiplier: int = 4
    attention_dropout: float = 0.1
    heatmap_sigma_px: float = 1.5

    def __post_init__(self):
        """Refuse a leader that is no arm, and sizes that do not fit together."""
        super().__post_init__()
        if self.leader not in ARMS:
            raise InvalidChoice("leader", self.leader, ARMS)
        if self.patch < 1 or self.patch % 2 == 0:
            raise ValueError(f"patch={self.patch} must be odd: kernels of this width need a centre")
        for option, divisor, why in (
            ("voxel_size", self.patch, "an image is cut into whole patches"),
            ("token_dim", 8, "each half is normalised in four groups"),
            ("attention_dim", self.heads, "the heads share the width evenly"),
            ("depth", 2, "half of the blocks stay within a view"),
        ):
            value = getattr(self, option)
            if value < divisor or value % divisor:
                raise ValueError(f"{option}={value} must be a multiple of {divisor}: {why}")
        if self.point_radius < 0 or self.heatmap_sigma_px <= 0:
            raise ValueError(
                f"point_radius={self.point_radius} must not be negative, and "
                f"heatmap_sigma_px={self.heatmap_sigma_px} must be positive"
            )
