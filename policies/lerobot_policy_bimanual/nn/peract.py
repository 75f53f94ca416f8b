"""The PerAct family's voxel transformer, for one arm (PerAct) or two (PerAct2)."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from lerobot_bimanual.codec_torch import DiscreteKeypose
from lerobot_policy_bimanual.nn.conv3d import (
    PATCH,
    ActivatedLinear,
    PatchConv3d,
    PointwiseConv3d,
    init_linear,
)
from lerobot_policy_bimanual.nn.dense_head import DenseTranslationHead
from lerobot_policy_bimanual.nn.factorised_head import FactorisedTranslationHead
from lerobot_policy_bimanual.nn.perceiver import PerceiverIO
from lerobot_policy_bimanual.nn.precision import at_least_float32
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.nn.voxel_grid import GRID_CHANNELS

HIDDEN = (256, 64)
"""Widths of the rotation and flags head (PerAct2 code)."""


class PerActNetwork(nn.Module):
    """Voxels, proprioception and language to one discrete keypose per arm.

    With the defaults of `PerActConfig` it has the parameters of the reference networks: 66 180 794 for two arms
    (PerAct2), 33 240 669 for one (PerAct), and 33 241 181 for one that is told the keypose of the other.

    Args:
        arms: Arms to predict.
        voxels: Voxels per axis, a multiple of `PATCH`.
        channels: Voxel feature channels.
        token_dim: Width of the transformer's input tokens; half voxels, half proprioception.
        proprio_dim: Numbers in the proprioception vector.
        language_tokens: Language tokens per instruction.
        language_dim: Width of the language tokens.
        num_latents: Perceiver latents, shared evenly by the arms; a single arm has them all.
        latent_dim: Width of the latents.
        depth: Self-attention blocks per arm.
        heads: Heads of the self-attentions.
        feedforward_multiplier: Inner over outer width of the feed-forwards.
        attention_dropout: Of the attention weights, in the reading and the self-attentions.
        rotation_bins: Bins per rotation axis.
        translation_head: "dense" (the paper's) or "factorised".
        voxel_cells: See `FactorisedTranslationHead`; 0 with the dense one.
        projection_dilations: See `FactorisedTranslationHead`; none with the dense one.
        checkpointing: Recompute the dense head in the backward pass instead of storing it.
    """

    def __init__(
        self,
        *,
        arms: int,
        voxels: int,
        channels: int,
        token_dim: int,
        proprio_dim: int,
        language_tokens: int,
        language_dim: int,
        num_latents: int,
        latent_dim: int,
        depth: int,
        heads: int,
        feedforward_multiplier: int,
        attention_dropout: float,
        rotation_bins: int,
        translation_head: str,
        voxel_cells: int,
        projection_dilations: Sequence[int],
        checkpointing: bool,
    ):
        super().__init__()
        self.rotation_bins = rotation_bins
        self.patches = voxels // PATCH
        dense = translation_head == "dense"
        self.stem = PointwiseConv3d(GRID_CHANNELS, channels)
        # PerAct2 pads the patches, which centres them on voxels 0, 5, 10, ... The factorised head instead needs
        # tokens that see exactly the voxels it then chooses from.
        self.patchify = PatchConv3d(channels, token_dim // 2, centred=dense)
        self.proprio = ActivatedLinear(proprio_dim, token_dim // 2)
        self.language = nn.Linear(language_dim, token_dim)
        init_linear(self.language)
        # Standard deviation 1 for the same reason as the latents of `PerceiverIO`.
        self.positions = nn.Parameter(torch.randn(language_tokens + self.patches**3, token_dim))
        self.perceiver = PerceiverIO(
            streams=arms,
            token_dim=token_dim,
            num_latents=num_latents,
            latent_dim=latent_dim,
            depth=depth,
            heads=heads,
            multiplier=feedforward_multiplier,
            dropout=attention_dropout,
        )
        self.translation = (
            DenseTranslationHead(
                arms=arms, channels=channels, token_dim=token_dim, checkpointing=checkpointing
            )
            if dense
            else FactorisedTranslationHead(
                arms=arms,
                channels=channels,
                token_dim=token_dim,
                cells=voxel_cells,
                dilations=projection_dilations,
            )
        )
        outputs = 3 * rotation_bins + 2 + 2
        self.pose_heads = nn.ModuleList(
            _pose_head(self.translation.feature_dim, outputs) for _ in range(arms)
        )

    def forward(
        self, grid: Tensor, proprio: Tensor, language: Tensor, target: DiscreteKeypose | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of every arm.

        Args:
            grid: (b, 10, v, v, v) as made by `voxelise`.
            proprio: (b, proprio_dim).
            language: (b, language_tokens, language_dim).
            target: Label of the arms in training; see `FactorisedTranslationHead`.
        """
        stem = self.stem(grid)  # (b, channels, v, v, v)
        patches = self.patchify(stem)  # (b, p^3, token_dim / 2), and as a map
        patch_map = patches.transpose(1, 2).unflatten(-1, (self.patches,) * 3)
        body = self.proprio(proprio)[:, None].expand(-1, patches.shape[1], -1)
        voxel_tokens = torch.cat([patches, body], dim=-1)  # (b, p^3, token_dim)
        tokens = torch.cat([self.language(language), voxel_tokens], dim=1) + self.positions
        # Only voxel tokens are asked for an answer; the reference also asks the words and drops the reply.
        answers = self.perceiver(tokens, tokens[:, language.shape[1] :])  # (b, arms, p^3, token_dim)
        answers = answers.transpose(2, 3).unflatten(-1, (self.patches,) * 3)
        target_voxel = None if target is None else target.voxel
        translation, features = self.translation(stem, patch_map, answers, target_voxel)
        logits = torch.stack([head(features[:, arm]) for arm, head in enumerate(self.pose_heads)], dim=1)
        rotation, gripper_open, ignore_collisions = at_least_float32(logits).split(
            (3 * self.rotation_bins, 2, 2), dim=-1
        )
        rotation = rotation.unflatten(-1, (3, self.rotation_bins))
        return KeyposePrediction(translation, rotation, gripper_open, ignore_collisions)


def _pose_head(inputs: int, outputs: int) -> nn.Sequential:
    last = nn.Linear(HIDDEN[1], outputs)
    init_linear(last)
    return nn.Sequential(ActivatedLinear(inputs, HIDDEN[0]), ActivatedLinear(*HIDDEN), last)
