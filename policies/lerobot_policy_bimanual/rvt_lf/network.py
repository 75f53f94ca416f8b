"""The Robotic View Transformer (RVT) for one arm: five views in, one discrete keypose out."""

from functools import partial

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.layers import LEAK, Block, LanguageFilters, activate, init_linear
from lerobot_policy_bimanual.nn.precision import at_least_float32
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.rvt_lf import layers
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig
from lerobot_policy_bimanual.rvt_lf.heatmaps import HeatmapTranslation, ProductTranslation
from lerobot_policy_bimanual.rvt_lf.point_renderer import QUADRATIC, VIEW_CHANNELS
from lerobot_policy_bimanual.rvt_lf.views import VIEWS


class RVTNetwork(nn.Module):
    """Rendered views, proprioception and language to one discrete keypose.

    The first half of the blocks attends within each view, the second half over all views and the instruction.

    Args:
        config: all sizes.
        proprio_dim: numbers in the proprioception vector.
        goal_channels: channels of the views, behind their own, that mark the goal of another arm.
    """

    def __init__(self, config: RVTLFConfig, *, proprio_dim: int, goal_channels: int = 0):
        super().__init__()
        channels, token_dim, patch = config.channels, config.token_dim, config.patch
        translation = HeatmapTranslation if config.heatmap_fusion == "mean" else ProductTranslation.of_views
        self.make_translation = partial(translation, sigma_px=config.heatmap_sigma_px)
        self.patches = config.voxel_size // patch
        self.quadratic_features = config.quadratic_features
        inputs = VIEW_CHANNELS + goal_channels + (QUADRATIC.stop - QUADRATIC.start) * self.quadratic_features
        self.stem = layers.Conv2d(inputs, channels, 1, activated=True)
        self.language_filters = (
            LanguageFilters(config.language_dim, inputs, channels) if config.language_filters else None
        )
        self.patchify = layers.PatchConv2d(channels, token_dim // 2, patch)
        self.proprio = layers.NormedLinear(proprio_dim, token_dim // 2)
        self.language = layers.NormedLinear(config.language_dim, token_dim)
        self.positions = nn.Parameter(torch.randn(len(VIEWS) * self.patches**2, token_dim))
        self.widen = nn.Linear(token_dim, config.attention_dim)
        self.narrow = nn.Linear(config.attention_dim, token_dim)
        self.within_views, self.over_views = _blocks(config), _blocks(config)
        self.coarse = layers.Conv2d(token_dim, channels, patch, activated=True)
        self.upsample = layers.UpsampledConv2d(channels, channels, patch)
        self.join = layers.SkipConv2d(channels)
        self.reach = nn.ModuleList(
            nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation)
            for dilation in config.heatmap_dilations
        )
        self.heatmap = layers.Conv2d(channels, 1, 3, activated=False)
        features = token_dim + channels
        last = nn.Linear(features // 2, 3 * config.codec.rotation_bins + 2 + 2)
        self.pose_head = nn.Sequential(
            nn.Linear(len(VIEWS) * features, features),
            nn.ReLU(),
            nn.Linear(features, features // 2),
            nn.ReLU(),
            last,
        )
        for layer in (self.widen, self.narrow, last):
            init_linear(layer)
        if config.compile:
            self.compile()  # in place: the names in the checkpoint stay the same

    def forward(self, views: Tensor, proprio: Tensor, language: Tensor) -> KeyposePrediction:
        """Predict the next keypose of one arm.

        Args:
            views: (b, 5, 10, size, size) as made by `render_views`, with `goal_channels` more behind.
            proprio: (b, proprio_dim).
            language: (b, language_tokens, language_dim).
        """
        stem = self.read(views, language)  # (b 5, channels, size, size)
        answers = self._attend(self.patchify(stem), proprio, language)  # (b 5, token_dim, p, p)
        fine = self.join(activate(self.upsample(self.coarse(answers))), stem)
        for layer in self.reach:
            fine = fine + layer(F.leaky_relu(fine, LEAK))
        logits = at_least_float32(self.heatmap(fine))  # (b 5, 1, size, size)

        heatmaps = logits.unflatten(0, (-1, len(VIEWS))).transpose(1, 2)  # (b, 1, 5, size, size)
        translation = self.make_translation(heatmaps)

        # The position of the pose features is trained by the translation loss alone, hence no gradient here.
        with torch.no_grad():
            attention = translation.pixel_probabilities().flatten(0, 2).flatten(1)  # (b 5, size^2)
        at_peak = (fine.flatten(2) @ attention.to(fine.dtype)[..., None])[..., 0]  # (b 5, channels)
        features = torch.cat([answers.amax((2, 3)), at_peak], dim=1).unflatten(0, (-1, len(VIEWS)))
        return KeyposePrediction.of_logits(translation, self.pose_head(features.flatten(1))[:, None])

    def read(self, views: Tensor, language: Tensor) -> Tensor:
        """Stem features (b 5, channels, size, size) of views (b, 5, 10, size, size), with language-conditioned filters."""
        if self.quadratic_features:
            views = torch.cat([views, views[:, :, QUADRATIC].square()], dim=2)
        if self.language_filters is None:
            return self.stem(views.flatten(0, 1))
        filters = self.language_filters(language.mean(dim=1)).unflatten(1, (-1, views.shape[2] + 1))
        weight = self.stem.weight.flatten(1) + filters[..., :-1]
        bias = self.stem.bias + filters[..., -1]
        pixels = torch.baddbmm(bias[..., None], weight, views.transpose(1, 2).flatten(2))
        by_view = activate(pixels).unflatten(2, views.shape[1:2] + views.shape[3:])
        return by_view.transpose(1, 2).flatten(0, 1)

    def _attend(self, patches: Tensor, proprio: Tensor, language: Tensor) -> Tensor:
        """The transformer's features (b 5, token_dim, p, p) of patches (b 5, p^2, token_dim / 2); the rest as in `forward`."""
        patches = patches.unflatten(0, (-1, len(VIEWS))).flatten(1, 2)  # (b, 5 p^2, token_dim / 2)
        proprio_features = self.proprio(proprio)[:, None].expand(-1, patches.shape[1], -1)
        images = self.widen(torch.cat([patches, proprio_features], dim=-1) + self.positions)
        words = self.widen(self.language(language))
        images = images.unflatten(1, (len(VIEWS), -1)).flatten(0, 1)  # (b 5, p^2, attention_dim)
        images = self.within_views(images).unflatten(0, (-1, len(VIEWS))).flatten(1, 2)
        tokens = self.over_views(torch.cat([words, images], dim=1))[:, words.shape[1] :]
        answers = self.narrow(tokens).unflatten(1, (len(VIEWS), -1)).flatten(0, 1)
        return answers.transpose(1, 2).unflatten(2, (self.patches, self.patches))


def _blocks(config: RVTLFConfig) -> nn.Sequential:
    """Half of the attention blocks."""
    dim, heads, dropout = config.attention_dim, config.heads, config.attention_dropout
    block = partial(Block, dim, heads=heads, multiplier=config.feedforward_multiplier, dropout=dropout)
    return nn.Sequential(*(block() for _ in range(config.depth // 2)))
