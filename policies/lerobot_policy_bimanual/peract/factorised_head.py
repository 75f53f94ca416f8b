"""A cheaper translation head: the distribution over voxels, factored into patch and voxel in patch.

p(voxel) = p(patch) p(voxel | patch) is exact. The second factor is only evaluated for the true patch in training and the
most probable patches at inference, so there is no decoder at full resolution. A third factor may refine the position:
each voxel has one softmax per axis over sub-voxel bins (cells), so that coarse, cheap voxels give fine positions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import torch
import torch.nn.functional as F  # noqa: N812
from einops import rearrange
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.layers import LEAK, activate
from lerobot_policy_bimanual.nn.precision import at_least_float32
from lerobot_policy_bimanual.nn.prediction import VoxelCandidates
from lerobot_policy_bimanual.peract.config import PATCH, PerActConfig
from lerobot_policy_bimanual.peract.convolutions import ActivatedConv3d, PatchConv3d, PointwiseConv3d
from lerobot_policy_bimanual.peract.pooling import pool
from lerobot_policy_bimanual.peract.stem_features import StemFeatures

BEAM = 8
"""Patches whose voxels are scored at inference."""

FINE_CHANNELS = 32
"""Width of the voxel-in-patch branch."""


@dataclass(frozen=True, eq=False)
class FactorisedTranslation:
    """A softmax over patches and one over the voxels of some patches.

    Attributes:
        patch_logits: (b, arms, p^3) float32.
        patches: (b, arms, n) int64, the most probable patches.
        voxel_logits: (b, arms, n, PATCH^3) float32, over the voxels of `patches`.
        target_voxel_logits: (b, arms, PATCH^3) float32, over the voxels of the target's patch; None without target.
        cell_logits: (b, arms, n, PATCH^3, 3, cells) float32, over the sub-voxel bins along each axis of every voxel of
            `patches`; zero cells without sub-voxel bins.
        target_cell_logits: (b, arms, PATCH^3, 3, cells) float32, for the target's patch; None without target.
    """

    patch_logits: Tensor
    patches: Tensor
    voxel_logits: Tensor
    target_voxel_logits: Tensor | None
    cell_logits: Tensor
    target_cell_logits: Tensor | None

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Negative log-likelihood (b, arms) of the target voxels (b, arms, 3), and of their sub-voxel bins if there are any."""
        if self.target_voxel_logits is None or self.target_cell_logits is None:
            raise ValueError("the head was run without target voxels")
        P = round(self.patch_logits.shape[-1] ** (1 / 3))
        patch, inner = split_voxel(voxel, P)
        coarse = F.cross_entropy(self.patch_logits.flatten(0, 1), patch.flatten(), reduction="none")
        fine = F.cross_entropy(self.target_voxel_logits.flatten(0, 1), inner.flatten(), reduction="none")
        loss = (coarse + fine).view_as(patch)
        cells = self.target_cell_logits.shape[-1]
        if not cells:
            return loss
        cell = ((offset + 0.5) * cells).long().clamp(0, cells - 1)  # (b, arms, 3)
        index = inner[..., None, None, None].expand(*inner.shape, 1, 3, cells)
        logits = self.target_cell_logits.gather(2, index)[:, :, 0]  # (b, arms, 3, cells)
        within = F.cross_entropy(logits.flatten(0, 2), cell.flatten(), reduction="none")
        return loss + within.view_as(cell).sum(dim=-1)

    def candidates(self) -> VoxelCandidates:
        """All voxels of the scored patches, with their joint log-probabilities."""
        P = round(self.patch_logits.shape[-1] ** (1 / 3))
        prior = self.patch_logits.log_softmax(dim=-1).gather(-1, self.patches)
        score = prior[..., None] + self.voxel_logits.log_softmax(dim=-1)
        corner = _place(self.patches, P) * PATCH
        step = torch.arange(PATCH, device=score.device)
        voxel = corner[..., None, :] + torch.cartesian_prod(step, step, step)  # (b, arms, n, PATCH^3, 3)
        offset = None
        if cells := self.cell_logits.shape[-1]:
            centres = (torch.arange(cells, device=score.device) + 0.5) / cells - 0.5
            offset = (self.cell_logits.softmax(dim=-1) @ centres).flatten(2, 3)
        return VoxelCandidates(voxel.flatten(2, 3), score.flatten(2), offset)

    def probabilities(self) -> Tensor:
        """Probabilities (b, arms, v, v, v) of all voxels, uniform within the patches that were not scored."""
        P = round(self.patch_logits.shape[-1] ** (1 / 3))
        patch = self.patch_logits.softmax(dim=-1)
        within = patch.new_full((*patch.shape, PATCH**3), PATCH**-3)
        index = self.patches[..., None].expand_as(self.voxel_logits)
        joint = patch[..., None] * within.scatter(2, index, self.voxel_logits.softmax(dim=-1))
        return rearrange(
            joint, "b a (X Y Z) (x y z) -> b a (X x) (Y y) (Z z)", X=P, Y=P, Z=P, x=PATCH, y=PATCH, z=PATCH
        )


def split_voxel(voxel: Tensor, patches: int) -> tuple[Tensor, Tensor]:
    """Flat indices of the patch and of the voxel in it, (...) each, of voxels (..., 3)."""
    outer, inner = voxel // PATCH, voxel % PATCH
    return (
        (outer[..., 0] * patches + outer[..., 1]) * patches + outer[..., 2],
        (inner[..., 0] * PATCH + inner[..., 1]) * PATCH + inner[..., 2],
    )


class ProjectionConv2d(nn.Conv2d):
    """A 3 x 3 convolution of a projection of the voxel features, and dilated residual ones.

    Every layer reaches as many voxels further as its dilation. With 3 and 9 every voxel up to 13 away is reached, which is
    half of a grid of 25.
    """

    def __init__(self, channels: int, width: int, dilations: Sequence[int]):
        super().__init__(channels, width, 3, padding=1)
        self.far = nn.ModuleList(
            nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation) for dilation in dilations
        )

    def forward(self, input: Tensor) -> Tensor:
        """(b, channels, v, v) to (b, width, v, v)."""
        features = super().forward(input)
        for layer in self.far:
            features = features + layer(F.leaky_relu(features, LEAK))
        return features


class VoxelInPatch(nn.Module):
    """Scores the voxels of single patches, and their sub-voxel bins.

    The inputs are the stem features around each voxel, their maxima along the three axis-aligned lines through it, and the
    trunk's answer. A hand that waits above an object is in empty space: only the line below it shows the object.
    """

    def __init__(self, channels: int, token_dim: int, cells: int, dilations: Sequence[int]):
        super().__init__()
        self.cells = cells
        self.stem = nn.Conv3d(channels, FINE_CHANNELS, 3)
        self.lines = nn.ModuleList(ProjectionConv2d(channels, FINE_CHANNELS, dilations) for _ in range(3))
        self.answer = nn.Linear(token_dim, FINE_CHANNELS * PATCH**3)
        self.out = nn.Linear(FINE_CHANNELS, 1 + 3 * cells)

    def along_lines(self, planes: Sequence[Tensor]) -> list[Tensor]:
        """Features of the stem's projections along x, y and z: (b, channels, v, v) each to (b, FINE_CHANNELS, v, v)."""
        return [layer(plane) for layer, plane in zip(self.lines, planes, strict=True)]

    def forward(
        self, crops: Tensor, along_lines: Sequence[Tensor], patches: Tensor, answers: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Score n patches of each of b samples.

        Args:
            crops: (b, n, channels, PATCH + 2, ...).
            along_lines: (b, FINE_CHANNELS, v, v) along x, y and z.
            patches: (b, n, 3) int64, place of the patches.
            answers: (b, n, token_dim).

        Returns:
            Logits (b, n, PATCH^3) of the voxels and (b, n, PATCH^3, 3, cells) of their sub-voxel bins, float32.
        """
        # (b, n, FINE_CHANNELS, 5, 5, 5)
        hidden = self.stem(crops.flatten(0, 1)).unflatten(0, crops.shape[:2])
        hidden = hidden + self.answer(answers).unflatten(2, (FINE_CHANNELS, PATCH, PATCH, PATCH))
        for axis, plane in enumerate(along_lines):
            windows = rearrange(plane, "b c (p i) (q j) -> b p q c i j", i=PATCH, j=PATCH)
            first, second = patches[..., [other for other in range(3) if other != axis]].unbind(-1)
            sample = torch.arange(len(patches), device=patches.device)[:, None]
            hidden = hidden + windows[sample, first, second].unsqueeze(3 + axis)
        logits = at_least_float32(self.out(activate(hidden).flatten(3).transpose(2, 3)))
        return logits[..., 0], logits[..., 1:].unflatten(-1, (3, self.cells))


class FactorisedTranslationHead(nn.Module):
    """Logits over patches for every arm, and over the voxels of chosen patches.

    The patch tokens are concatenated with the trunk's answers, as the voxel features are in the paper's decoder. With
    `projection_dilations` the projections score the patches, too.
    """

    def __init__(self, config: PerActConfig, *, arms: int):
        super().__init__()
        channels, token_dim = config.channels, config.token_dim
        cells, dilations = config.voxel_cells, config.projection_dilations
        self.refine = ActivatedConv3d(token_dim + token_dim // 2, token_dim, 3)
        self.patch_logits = nn.ModuleList(nn.Linear(token_dim, 1) for _ in range(arms))
        self.voxel_logits = nn.ModuleList(
            VoxelInPatch(channels, token_dim, cells, dilations) for _ in range(arms)
        )
        self.patch_lines = nn.ModuleList(nn.Linear(FINE_CHANNELS, 1) for _ in range(arms if dilations else 0))
        self.feature_dim = channels + 4 * token_dim + 4 * token_dim + token_dim

    def read(
        self, grid: Tensor, stem: PointwiseConv3d, patchify: PatchConv3d, filters: Tensor | None
    ) -> tuple[StemFeatures, Tensor]:
        """Compute stem features of a grid (b, 10, v, v, v) with language-conditioned filters, and patch tokens."""
        features = StemFeatures(grid, stem, patchify, filters)
        heads = (cast(VoxelInPatch, head) for head in self.voxel_logits)
        features.along_lines = [head.along_lines(features.planes) for head in heads]
        return features, features.tokens

    def forward(
        self, stem: StemFeatures, patches: Tensor, answers: Tensor, target_voxel: Tensor | None
    ) -> tuple[FactorisedTranslation, Tensor]:
        """Score the patches, and the voxels of chosen patches.

        Args:
            stem: voxel features.
            patches: (b, token_dim / 2, p, p, p) patch tokens.
            answers: (b, arms, token_dim, p, p, p) the trunk's features of each patch.
            target_voxel: (b, arms, 3) in training, whose patch is scored and whose token feeds the pose heads (teacher
                forcing). None at inference: the most probable patch takes its place.

        Returns:
            The distribution, and features (b, arms, feature_dim): stem (max-pooled), answers, and the chosen patch's token.
        """
        A, P = answers.shape[1], answers.shape[-1]
        own = patches[:, None].expand(-1, A, -1, -1, -1, -1)
        refined = self.refine(torch.cat([answers, own], dim=2).flatten(0, 1))
        refined = refined.unflatten(0, (-1, A))  # (b, arms, token_dim, p, p, p)
        tokens = refined.flatten(3).transpose(2, 3)  # (b, arms, p^3, token_dim)
        patch_logits = at_least_float32(
            torch.stack([head(tokens[:, arm])[..., 0] for arm, head in enumerate(self.patch_logits)], dim=1)
        )
        along_lines = stem.along_lines
        if self.patch_lines:
            logits = [_patch_logits(*pair) for pair in zip(self.patch_lines, along_lines, strict=True)]
            patch_logits = patch_logits + at_least_float32(torch.stack(logits, dim=1))
        training = target_voxel is not None
        patch = target_logits = target_cells = None
        if target_voxel is not None:
            # First, because autocast of torch 2.7 goes on using weights that it has converted without gradient.
            patch = split_voxel(target_voxel, P)[0]
            scores = self._score(stem, along_lines, tokens, patch[..., None])
            target_logits, target_cells = (score[:, :, 0] for score in scores)
        # In training the prediction is only reported: one patch, no gradient.
        with torch.set_grad_enabled(torch.is_grad_enabled() and not training):
            best = patch_logits.topk(1 if training else min(BEAM, P**3), dim=-1).indices  # (b, arms, n)
            voxel_logits, cell_logits = self._score(stem, along_lines, tokens, best)
        if patch is None:
            score = patch_logits.gather(-1, best) + voxel_logits.log_softmax(dim=-1).amax(dim=-1)
            patch = best.gather(-1, score.argmax(dim=-1, keepdim=True)).squeeze(-1)  # of the best voxel
        features = [
            at_least_float32(stem.planes[0].flatten(2).max(dim=-1).values)[:, None].expand(-1, A, -1),
            pool(answers.flatten(0, 1)).unflatten(0, (-1, A)),
            pool(refined.flatten(0, 1)).unflatten(0, (-1, A)),
            at_least_float32(_take(tokens, patch[..., None])[:, :, 0]),
        ]
        prediction = FactorisedTranslation(
            patch_logits, best, voxel_logits, target_logits, cell_logits, target_cells
        )
        return prediction, torch.cat(features, dim=-1)

    def _score(
        self, stem: StemFeatures, along_lines: Sequence[Sequence[Tensor]], tokens: Tensor, patches: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Logits of the voxels in patches (b, arms, n): (b, arms, n, PATCH^3), and with (..., 3, cells) of cells."""
        place = _place(patches, round(tokens.shape[2] ** (1 / 3)))  # (b, arms, n, 3)
        crops = stem.crop(place)
        scores = []
        for arm, head in enumerate(self.voxel_logits):
            answers = _take(tokens[:, arm, None], patches[:, arm, None])[:, 0]
            scores.append(head(crops[:, arm], along_lines[arm], place[:, arm], answers))
        voxels, cells = (torch.stack(logits, dim=1) for logits in zip(*scores, strict=True))
        return voxels, cells


def _patch_logits(layer: nn.Module, along_lines: Sequence[Tensor]) -> Tensor:
    """Logits (b, p^3) of patches from the maxima over their voxels of line features, (b, FINE_CHANNELS, v, v) each."""
    pooled = [F.max_pool2d(plane, PATCH).unsqueeze(2 + axis) for axis, plane in enumerate(along_lines)]
    seen = activate(pooled[0] + pooled[1] + pooled[2])  # (b, FINE_CHANNELS, p, p, p)
    return layer(seen.flatten(2).transpose(1, 2))[..., 0]


def _place(patches: Tensor, size: int) -> Tensor:
    """Place (..., 3) of patches (...) on their lattice of size^3."""
    return torch.stack([patches // size**2, patches // size % size, patches % size], dim=-1)


def _take(tokens: Tensor, patches: Tensor) -> Tensor:
    """Rows `patches` (b, arms, n) of tokens (b, arms, p^3, token_dim)."""
    return tokens.gather(2, patches[..., None].expand(-1, -1, -1, tokens.shape[-1]))
