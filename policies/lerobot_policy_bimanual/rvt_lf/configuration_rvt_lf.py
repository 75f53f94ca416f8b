"""Config of RVT-LF, with the sizes of its networks."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig
from lerobot_policy_bimanual.keypose.fields import choice, number, require_dilations, require_multiple


@PreTrainedConfig.register_subclass("rvt_lf")
@dataclass
class RVTLFConfig(KeyposePolicyConfig):
    """RVT-LF: one five-view RVT per arm, the follower's being told the leader's next keypose.

    The defaults are the networks of PerAct2's baseline. The recipe `small` of `lerobot-bimanual policy benchmark` has the flags
    of networks that train on a laptop's CPU.
    """

    # Pixels per side of every view, and so the voxels per axis from which positions are chosen (RVT code: 220 of both).
    voxel_size: int = number(220, 1, 512)
    # Pixels per side of a patch; odd, so that kernels of this width have a centre.
    patch: int = number(11, 1, 99)
    # Radius of a rendered point in units of the workspace's half edge.
    point_radius: float = number(0.012, 0, 0.2)
    # Magnification at which a second network sees the surroundings of the position that the first predicts,
    # as in RVT-2; 1 for no second one. With `decode=voxel` its position is rounded to voxels of the first.
    fine_stage_zoom: int = number(1, 1, 8)
    # Width of the image tokens outside the attention, half pixels and half proprioception.
    token_dim: int = number(128, 16, 8192)  # each half is normalised in four groups of at least two
    # Width of the tokens within it.
    attention_dim: int = number(512, 1, 8192)
    # Attention blocks; the first half within each view, the second half over all of them.
    depth: int = number(8, 2, 64)
    heatmap_sigma_px: float = number(1.5, 0.01, 20)  # standard deviation of the heatmaps' Gaussian targets
    # A voxel's probability is the `mean` of the heatmaps where it is seen, each of which is trained by itself, as in RVT; or
    # their `product`, which is trained as a whole: a view that cannot tell leaves it to the others.
    heatmap_fusion: str = choice("mean", "product")
    # Dilations of further convolutions over each view; each sees that many pixels further on every side
    # (departure from the paper).
    heatmap_dilations: tuple[int, ...] = ()
    # Squared positions and colours are further channels of the views, as in `PerActConfig` (departure from the paper).
    quadratic_features: bool = False
    leader: str = choice("right", "left")  # the arm that decides first, `left` or `right` (the paper's)
    # The follower sees the leader's goal, as one more channel of its views; in the paper it has its numbers only.
    follower_sees_goal: bool = False

    def __post_init__(self):
        """Refuse sizes that do not fit together, too."""
        super().__post_init__()
        if self.patch % 2 == 0:
            raise BadConfig(f"patch={self.patch} must be odd: kernels of this width need a centre")
        if self.fine_stage_zoom > 1 and self.heatmap_fusion != "product":
            raise BadConfig(
                f"fine_stage_zoom={self.fine_stage_zoom} multiplies the distributions of two stages, which needs "
                f"heatmap_fusion=product, not {self.heatmap_fusion}; or set fine_stage_zoom=1"
            )
        require_dilations(self, "heatmap_dilations")
        require_multiple(self, "voxel_size", self.patch, "an image is cut into whole patches")
        require_multiple(self, "token_dim", 8, "each half is normalised in four groups")
        require_multiple(self, "attention_dim", self.heads, "the heads share the width evenly")
        require_multiple(self, "depth", 2, "half of the blocks stay within a view")
