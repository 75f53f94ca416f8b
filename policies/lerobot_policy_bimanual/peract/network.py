"""The PerAct family's voxel transformer, for one arm (PerAct) or two (PerAct2)."""

from functools import partial
from typing import Any

import torch
from torch import Tensor, nn

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual.nn.layers import (
    Attention,
    Block,
    FeedForward,
    LanguageFilters,
    activate,
    init_activated,
    init_linear,
)
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.peract.config import PATCH, PerActConfig
from lerobot_policy_bimanual.peract.convolutions import PatchConv3d, PointwiseConv3d
from lerobot_policy_bimanual.peract.dense_head import DenseTranslationHead
from lerobot_policy_bimanual.peract.factorised_head import FactorisedTranslationHead
from lerobot_policy_bimanual.peract.voxel_grid import GRID_CHANNELS, QUADRATIC

CROSS_HEAD_DIM = 64
"""Both cross-attentions have a single head of this width (PerAct2 code)."""

HIDDEN = (256, 64)
"""Widths of the rotation and flags head (PerAct2 code)."""


class PerceiverIO(nn.Module):
    """The trunk: one stream of latents per arm, which meet in one last block.

    All latents read the input together. They are then split evenly among the streams, each with weights of
    its own. With two or more streams a last block runs over all latents; it is the only place after the
    reading where the arms talk. With one stream it is left out, which is the single-arm PerAct.
    """

    def __init__(self, config: PerActConfig, *, streams: int):
        super().__init__()
        dim, token_dim, dropout = config.latent_dim, config.token_dim, config.attention_dropout
        # Standard deviation 1, not the usual 0.02: the decoder has no residual, and small codes leave it
        # unable to tell its queries apart.
        self.latents = nn.Parameter(torch.randn(config.num_latents, dim))
        self.read = Attention(dim, context_dim=token_dim, heads=1, head_dim=CROSS_HEAD_DIM, dropout=dropout)
        self.read_feed_forward = nn.ModuleList(
            FeedForward(dim, config.feedforward_multiplier) for _ in range(streams)
        )
        block = partial(
            Block, dim, heads=config.heads, multiplier=config.feedforward_multiplier, dropout=dropout
        )
        self.streams = nn.ModuleList(
            nn.Sequential(*(block() for _ in range(config.depth))) for _ in range(streams)
        )
        self.combine = block() if streams > 1 else nn.Identity()
        self.answer = nn.ModuleList(
            Attention(token_dim, context_dim=dim, heads=1, head_dim=CROSS_HEAD_DIM) for _ in range(streams)
        )

    def forward(self, tokens: Tensor, queries: Tensor) -> Tensor:
        """Read `tokens` (b, t, token_dim), answer `queries` (b, q, token_dim): (b, streams, q, token_dim)."""
        latents = self.latents.expand(len(tokens), -1, -1)
        latents = latents + self.read(latents, tokens)
        split = latents.chunk(len(self.streams), dim=1)
        layers = zip(split, self.read_feed_forward, self.streams, strict=True)
        parts = [stream(part + feed_forward(part)) for part, feed_forward, stream in layers]
        parts = self.combine(torch.cat(parts, dim=1)).chunk(len(self.streams), dim=1)
        answers = [answer(queries, part) for answer, part in zip(self.answer, parts, strict=True)]
        return torch.stack(answers, dim=1)


class PerActNetwork(nn.Module):
    """Voxels, proprioception and language to one discrete keypose per arm.

    Args:
        config: all sizes.
        arms: arms to predict; they share the latents evenly.
        proprio_dim: numbers in the proprioception vector.
        goal_channels: channels of the grid, behind its own, that mark the goal of another arm.
        joint: decode the second arm given the first one's voxel; with two arms.
    """

    def __init__(
        self,
        config: PerActConfig,
        *,
        arms: int,
        proprio_dim: int,
        goal_channels: int = 0,
        joint: bool = False,
    ):
        super().__init__()
        channels, token_dim = config.channels, config.token_dim
        self.patches = config.voxel_size // PATCH
        dense = config.translation_head == "dense"
        self.quadratic_features = config.quadratic_features
        inputs = GRID_CHANNELS + goal_channels + (QUADRATIC.stop - QUADRATIC.start) * self.quadratic_features
        self.stem = PointwiseConv3d(inputs, channels)
        self.language_filters = (
            LanguageFilters(config.language_dim, inputs, channels) if config.language_filters else None
        )
        # PerAct2 pads the patches, which centres them on voxels 0, 5, 10, ... The factorised head instead needs
        # tokens that see exactly the voxels it then chooses from.
        self.patchify = PatchConv3d(channels, token_dim // 2, centred=dense)
        self.proprio = _activated_linear(proprio_dim, token_dim // 2)
        self.language = nn.Linear(config.language_dim, token_dim)
        init_linear(self.language)
        # Standard deviation 1 for the same reason as the latents of `PerceiverIO`.
        self.positions = nn.Parameter(torch.randn(config.language_tokens + self.patches**3, token_dim))
        self.perceiver = PerceiverIO(config, streams=arms)
        head = DenseTranslationHead if dense else FactorisedTranslationHead
        self.translation: Any = head(config, arms=arms)
        features, outputs = self.translation.feature_dim, 3 * config.codec.rotation_bins + 2 + 2
        self.pose_heads = nn.ModuleList(_MLP(features, *HIDDEN, outputs) for _ in range(arms))
        self.goal = FirstArmGoalEncoder(token_dim, self.patches) if joint else None
        if config.compile:
            self.compile()  # in place: the names in the checkpoint stay the same

    def forward(
        self, grid: Tensor, proprio: Tensor, language: Tensor, target: KeyposeBins | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of every arm.

        Args:
            grid: (b, 10, v, v, v) as made by `voxelise`, with `goal_channels` more behind.
            proprio: (b, proprio_dim).
            language: (b, language_tokens, language_dim).
            target: label of the arms in training; see `FactorisedTranslationHead`.
        """
        if self.quadratic_features:
            grid = torch.cat([grid, grid[:, QUADRATIC].square()], dim=1)
        filters = None
        if self.language_filters is not None:
            filters = self.language_filters(language.mean(dim=1)).unflatten(1, (-1, grid.shape[1] + 1))
        stem, patches = self.translation.read(grid, self.stem, self.patchify, filters)
        patch_map = patches.transpose(1, 2).unflatten(-1, (self.patches,) * 3)
        proprio_features = activate(self.proprio(proprio))[:, None].expand(-1, patches.shape[1], -1)
        voxel_tokens = torch.cat(
            [patches, proprio_features], dim=-1
        )  # (b, p^3, token_dim), half of it from the patches
        tokens = torch.cat([self.language(language), voxel_tokens], dim=1) + self.positions
        # Only voxel tokens are queries; the reference also queries language tokens and drops their answers.
        answers = self.perceiver(tokens, tokens[:, language.shape[1] :])  # (b, arms, p^3, token_dim)
        answers = answers.transpose(2, 3).unflatten(-1, (self.patches,) * 3)
        target_voxel = None if target is None else target.voxel
        if self.goal is not None:
            first = target_voxel
            if first is None:
                first = self.translation(stem, patch_map, answers, None)[0].candidates().best()
            answers = self.goal(answers, first[:, 0])
        translation, features = self.translation(stem, patch_map, answers, target_voxel)
        logits = torch.stack([head(features[:, arm]) for arm, head in enumerate(self.pose_heads)], dim=1)
        return KeyposePrediction.of_logits(translation, logits)


class FirstArmGoalEncoder(nn.Module):
    """Tells the second arm, at every patch, where the first arm's goal lies from there.

    The arms' voxels are drawn from p(first) p(second | first) instead of a product of marginals.
    """

    def __init__(self, token_dim: int, patches: int):
        super().__init__()
        self.patches = patches
        self.layers = _MLP(4, HIDDEN[1], HIDDEN[1], token_dim)

    def forward(self, answers: Tensor, voxel: Tensor) -> Tensor:
        """Answers (b, 2, token_dim, p, p, p), the second arm's with the direction to the first arm's voxels (b, 3) added."""
        centres = PATCH * torch.arange(self.patches, device=voxel.device) + PATCH // 2
        lattice = torch.stack(torch.meshgrid(centres, centres, centres, indexing="ij"), dim=-1)
        offset = (voxel[:, None, None, None] - lattice) / PATCH  # (b, p, p, p, 3), in patches
        distance = offset.norm(dim=-1, keepdim=True)
        goal_features = self.layers(torch.cat([offset, distance], dim=-1)).movedim(-1, 1)
        return torch.stack([answers[:, 0], answers[:, 1] + goal_features], dim=1)


class _MLP(nn.Sequential):
    """Two activated layers and a linear one."""

    def __init__(self, inputs: int, first: int, second: int, outputs: int):
        last = nn.Linear(second, outputs)  # made first: what a seed gives depends on that order
        init_linear(last)
        super().__init__(_activated_linear(inputs, first), _activated_linear(first, second), last)

    def forward(self, input: Tensor) -> Tensor:
        """(..., inputs) -> (..., outputs)."""
        first, second, last = self
        return last(activate(second(activate(first(input)))))


def _activated_linear(inputs: int, outputs: int) -> nn.Linear:
    """A layer whose output its caller activates: an adapter has to act before that, or merging it would change the network."""
    layer = nn.Linear(inputs, outputs)
    init_activated(layer)
    return layer
