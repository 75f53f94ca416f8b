"""What the PerAct variants have in common in their configs."""

from dataclasses import dataclass

from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig
from lerobot_policy_bimanual.keypose.fields import choice, number, require_dilations, require_multiple

PATCH = 5
"""Voxels per patch along each axis (PerAct2 code)."""


@dataclass
class PerActConfig(KeyposePolicyConfig):
    """Base config of the PerAct variants; the defaults are the paper's network.

    `docs/policies.md` has the flags of a small one that trains in minutes on a laptop's CPU.
    """

    # Width of the Perceiver's input tokens, half voxels and half proprioception.
    token_dim: int = number(128, 2, 8192)
    # Perceiver latents per network, shared evenly by the arms that it predicts.
    num_latents: int = number(2048, 1, 65536)
    # Width of the latents.
    latent_dim: int = number(512, 1, 8192)
    # Self-attention blocks per arm.
    depth: int = number(6, 1, 64)
    # `dense`, the paper's softmax over all voxels, or `factorised`, the same distribution as patch times voxel in patch,
    # several times cheaper.
    translation_head: str = choice("dense", "factorised")
    # With the factorised head, sub-voxel bins per axis, so that `decode=expectation` is finer than a voxel; 0 for none
    # (departure from the paper).
    voxel_cells: int = number(0, 0, 100)
    # With the factorised head, dilations of further convolutions over the projections of the voxel features;
    # each sees that many voxels further on every side: [3,9] for targets in free space at 25 voxels
    # (departure from the paper).
    projection_dilations: tuple[int, ...] = ()
    # Append the squares of colours and voxel indices to the grid, so that one filter can peak inside a range: at purple,
    # between red and blue, or at the middle drawer (departure from the paper).
    quadratic_features: bool = False
    activation_checkpointing: bool = False  # recompute the dense head backwards: less memory, more time

    def __post_init__(self):
        """Refuse sizes that do not fit together, too."""
        super().__post_init__()
        require_dilations(self, "projection_dilations")
        if self.voxel_cells == 1:
            raise BadConfig("voxel_cells=1 must be 0, or at least 2")
        for name in ("voxel_cells", "projection_dilations", "language_filters"):
            if self.translation_head == "dense" and getattr(self, name):
                raise BadConfig(f"{name}={getattr(self, name)} needs translation_head=factorised")
        require_multiple(self, "voxel_size", PATCH, "a patch is five voxels wide")
        require_multiple(self, "token_dim", 2, "half of a token is proprioception")
        require_multiple(self, "latent_dim", self.heads, "the heads share the latent evenly")
