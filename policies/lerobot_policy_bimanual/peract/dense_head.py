"""The paper's translation head: a U-Net decoder with one logit per voxel."""

from dataclasses import dataclass

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn
from torch.utils.checkpoint import checkpoint

from lerobot_policy_bimanual.nn.layers import activate, init_activated
from lerobot_policy_bimanual.nn.precision import at_least_float32
from lerobot_policy_bimanual.nn.prediction import VoxelCandidates, neighbours
from lerobot_policy_bimanual.peract.config import PerActConfig
from lerobot_policy_bimanual.peract.convolutions import (
    ActivatedConv3d,
    PatchConv3d,
    PointwiseConv3d,
    pad_replicate,
)
from lerobot_policy_bimanual.peract.pooling import pool
from lerobot_policy_bimanual.peract.upsample import UpsampledConv3d


@dataclass(frozen=True, eq=False)
class DenseTranslation:
    """One softmax over all voxels.

    Attributes:
        logits: (b, arms, v, v, v) float32.
    """

    logits: Tensor

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Negative log-likelihood (b, arms) of target voxels (b, arms, 3), from indices, not one-hots."""
        V = self.logits.shape[-1]
        flat = (voxel[..., 0] * V + voxel[..., 1]) * V + voxel[..., 2]
        loss = F.cross_entropy(self.logits.flatten(2).flatten(0, 1), flat.flatten(), reduction="none")
        return loss.view_as(flat)

    def candidates(self) -> VoxelCandidates:
        """The most probable voxel and its 26 neighbours."""
        V = self.logits.shape[-1]
        flat = self.logits.flatten(2)
        best = flat.argmax(dim=-1)
        best = torch.stack([best // V**2, best // V % V, best % V], dim=-1)  # (b, arms, 3)
        voxel, inside = neighbours(best, V)  # (b, arms, 27, 3)
        index = ((voxel[..., 0] * V + voxel[..., 1]) * V + voxel[..., 2]).clamp(0, V**3 - 1)
        return VoxelCandidates(voxel, flat.gather(-1, index).masked_fill(~inside, -torch.inf))

    def probabilities(self) -> Tensor:
        """Probabilities (b, arms, v, v, v) of all voxels."""
        return self.logits.flatten(2).softmax(dim=-1).view_as(self.logits)


class SkipConv3d(nn.Module):
    """3x3x3 convolution of a skip map concatenated with another map; the skip half is computed once for all arms."""

    def __init__(self, channels: int):
        super().__init__()
        self.conv = nn.Conv3d(2 * channels, channels, 3)
        init_activated(self.conv)

    def skip_half(self, skip: Tensor) -> Tensor:
        """Contribution (b, c, v, v, v) of the skip map, with the bias."""
        channels = self.conv.out_channels
        return F.conv3d(pad_replicate(skip, 1, 1), self.conv.weight[:, :channels], self.conv.bias)

    def forward(self, skip_half: Tensor, x: Tensor) -> Tensor:
        """Add `skip_half(...)` and the convolution of x (b, c, v + 2, v + 2, v + 2), which is padded already; LeakyReLU."""
        channels = self.conv.out_channels
        return activate(F.conv3d(x, self.conv.weight[:, channels:]).add_(skip_half))


class LogitConv3d(nn.Module):
    """3x3x3 convolution to one logit per voxel: one matrix product, then 27 shifted additions."""

    def __init__(self, channels: int):
        super().__init__()
        self.weight = nn.Parameter(torch.empty(1, channels, 3, 3, 3))
        self.bias = nn.Parameter(torch.zeros(1))
        nn.init.xavier_uniform_(self.weight)

    def forward(self, x: Tensor) -> Tensor:
        """(b, c, v, v, v) -> (b, v, v, v), at least float32."""
        X, Y, Z = x.shape[2:]
        per_tap = self.weight[0].flatten(1).T  # (27, c)
        voxels = x.permute(0, 2, 3, 4, 1).flatten(1, 3)  # (b, v^3, c)
        fields = pad_replicate((per_tap @ voxels.mT).unflatten(2, (X, Y, Z)), 1, 1).unbind(1)
        logits = at_least_float32(self.bias)
        for tap, field in enumerate(fields):
            i, j, k = tap // 9, tap // 3 % 3, tap % 3
            logits = logits + field[:, i : i + X, j : j + Y, k : k + Z]
        return logits


class DenseTranslationHead(nn.Module):
    """Upsamples patches to voxels and joins them with the voxel stem; the arms share all weights but the last layer's."""

    def __init__(self, config: PerActConfig, *, arms: int):
        super().__init__()
        channels, token_dim = config.channels, config.token_dim
        self.checkpointing = config.activation_checkpointing
        self.coarse = ActivatedConv3d(token_dim, channels, 5)
        self.upsample = UpsampledConv3d(channels, channels)
        self.join = SkipConv3d(channels)
        self.logits = nn.ModuleList(LogitConv3d(channels) for _ in range(arms))
        self.feature_dim = 4 * channels + 4 * token_dim + 4 * channels

    @staticmethod
    def read(
        grid: Tensor, stem: PointwiseConv3d, patchify: PatchConv3d, filters: None
    ) -> tuple[Tensor, Tensor]:
        """Compute stem features of a grid (b, 10, v, v, v), and patch tokens (b, p^3, token_dim / 2)."""
        features = stem(grid)
        return features, patchify(features)

    def forward(
        self, stem: Tensor, patches: Tensor, answers: Tensor, target_voxel: Tensor | None
    ) -> tuple[DenseTranslation, Tensor]:
        """Score every voxel for every arm.

        Args:
            stem: (b, channels, v, v, v) voxel features.
            patches: not used; the factorised head needs them.
            answers: (b, arms, token_dim, p, p, p) the trunk's features of each patch.
            target_voxel: not used; the factorised head needs it.

        Returns:
            The distribution, and pooled features (b, arms, feature_dim) of stem, answers and fine map.
        """
        skip_half = self.join.skip_half(stem)
        kernel = self.upsample.kernel()
        stem_features = pool(stem)
        logits, features = [], []
        for arm, answer in enumerate(answers.unbind(1)):
            inputs = (arm, answer, skip_half, kernel)
            if self.checkpointing and torch.is_grad_enabled():
                arm_logits, fine_features = checkpoint(self._decode, *inputs, use_reentrant=False)  # type: ignore[misc]
            else:
                arm_logits, fine_features = self._decode(*inputs)
            logits.append(arm_logits)
            features.append(torch.cat([stem_features, pool(answer), fine_features], dim=1))
        return DenseTranslation(torch.stack(logits, dim=1)), torch.stack(features, dim=1)

    def _decode(self, arm: int, answer: Tensor, skip_half: Tensor, kernel: Tensor) -> tuple[Tensor, Tensor]:
        fine = self.join(skip_half, self.upsample(self.coarse(answer), kernel))
        return self.logits[arm](fine), pool(fine)
