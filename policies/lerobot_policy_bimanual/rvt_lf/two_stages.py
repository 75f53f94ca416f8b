"""RVT in two stages, coarse and fine, as in RVT-2 (Goyal et al., 2024, https://arxiv.org/abs/2406.08545)."""

from dataclasses import dataclass, replace
from typing import Self

import torch
from torch import Tensor, nn

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual.nn.precision import full_precision
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction, VoxelCandidates
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig
from lerobot_policy_bimanual.rvt_lf.heatmaps import ProductTranslation
from lerobot_policy_bimanual.rvt_lf.network import RVTNetwork
from lerobot_policy_bimanual.rvt_lf.scene import Scene
from lerobot_policy_bimanual.rvt_lf.views import magnified, reduced

JITTER = 0.75
"""Largest distance of the label from the middle of zoomed-in views in training, along each axis, in half edges of a view."""


class StagedRVT(nn.Module):
    """Predicts one arm's keypose by one RVT or, with `fine_stage_zoom`, by two.

    The coarse stage sees the whole workspace. The fine stage sees the surroundings of the position that the coarse one
    predicts; in training, surroundings of the label with a random offset. The logits of both stages are added; for the
    position, at the fine stage's voxels (departure from RVT-2, whose fine stage alone gives the position).

    Args:
        config: all sizes.
        **sizes: of the proprioception and the goal's channel, as for `RVTNetwork`.
    """

    def __init__(self, config: RVTLFConfig, **sizes: int):
        super().__init__()
        self.zoom = config.fine_stage_zoom
        self.half_view = config.voxel_size / 2 / self.zoom  # of the fine stage, in coarse voxels
        self.last_voxel = config.voxel_size - 1
        self.coarse = RVTNetwork(config, **sizes)
        self.fine = RVTNetwork(config, **sizes) if self.zoom > 1 else None

    def forward(
        self, scene: Scene, proprio: Tensor, language: Tensor, target: KeyposeBins | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of one arm.

        Args:
            scene: what the arm sees.
            proprio: (b, proprio_dim).
            language: (b, tokens, dim).
            target: label of the arm in training; None at inference.
        """
        coarse = self.coarse(scene.whole, proprio, language)
        if self.fine is None:
            return coarse
        if self.training and target is not None:
            label = target.voxel_position[:, 0]
            middle = label + JITTER * self.half_view * (2 * torch.rand_like(label) - 1)
        else:
            middle = coarse.translation.candidates().local_mean()[:, 0]
        # All of the view is within the workspace, so that the position is.
        border = self.half_view - 0.5
        middle = middle.clamp(border, self.last_voxel - border)
        fine = self.fine(scene.zoomed_in(middle), proprio, language)
        return KeyposePrediction(
            FineTranslation.of(coarse.translation, fine.translation, middle[:, None], self.zoom),
            coarse.rotation + fine.rotation,
            coarse.gripper_open + fine.gripper_open,
            coarse.ignore_collisions + fine.ignore_collisions,
        )


@dataclass(frozen=True, eq=False)
class FineTranslation:
    """Distributions over the voxels of the workspace and over finer ones around a position; the finer ones decide.

    Attributes:
        coarse: over the workspace.
        fine: over the zoomed-in surroundings, of both stages.
        middle: (b, 1, 3) the middle of the surroundings, in coarse voxels.
        zoom: fine voxels per coarse voxel, along each axis.
    """

    coarse: ProductTranslation
    fine: ProductTranslation
    middle: Tensor
    zoom: int

    @classmethod
    def of(cls, coarse: ProductTranslation, fine: ProductTranslation, middle: Tensor, zoom: int) -> Self:
        """Multiply `fine`, which is from zoomed-in views alone, by `coarse`: in free space the zoomed-in views see nothing."""
        size = fine.planes[0].shape[-1]
        voxel_position = reduced(
            torch.arange(size, device=middle.device)[:, None], middle, zoom, size
        )  # (b, v, 3)
        x, y, z = cubic_weights(voxel_position.mT, size)[:, :, None].unbind(1)  # (b, 1, v, v) each
        axes = ((x, y), (x, z), (y, z))
        with full_precision(middle.device):
            planes = tuple(
                ours + first @ wider @ second.mT
                for ours, wider, (first, second) in zip(fine.planes, coarse.planes, axes, strict=True)
            )
        return cls(coarse, replace(fine, planes=planes), middle, zoom)

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Sum (b, 1) of the cross-entropies of both stages; targets outside the surroundings count as at their border."""
        size = self.fine.planes[0].shape[-1]
        voxel_position = magnified(voxel + offset, self.middle, self.zoom, size).clamp(0, size - 1)
        fine = voxel_position.round()
        return self.coarse.cross_entropy(voxel, offset) + self.fine.cross_entropy(
            fine.long(), voxel_position - fine
        )

    def candidates(self) -> VoxelCandidates:
        """The candidates of the fine stage, in coarse voxels."""
        found = self.fine.candidates()
        voxel_position = reduced(
            found.voxel, self.middle[:, :, None], self.zoom, self.fine.planes[0].shape[-1]
        )
        voxel = voxel_position.round().long()
        return VoxelCandidates(voxel, found.score, voxel_position - voxel)

    def probabilities(self) -> Tensor:
        """Probabilities (b, 1, v, v, v) of the coarse voxels: those of the best fine voxel in each, scaled to add up to 1."""
        fine = self.fine.probabilities()
        size = fine.shape[-1]
        axis = torch.arange(size, device=fine.device)[:, None]
        x, y, z = reduced(axis, self.middle, self.zoom, size).round().long().unbind(2)  # (b, v) each
        voxel = (x[:, :, None, None] * size + y[:, None, :, None]) * size + z[:, None, None]
        best = torch.zeros_like(fine.flatten(1)).scatter_reduce_(1, voxel.flatten(1), fine.flatten(1), "amax")
        return (best / best.sum(dim=1, keepdim=True)).view_as(fine)


def cubic_weights(voxel_position: Tensor, size: int) -> Tensor:
    """Weights (..., size) with which samples at 0, 1, ... interpolate a smooth function at places (...).

    Cubic convolution (Keys, 1981): exact between the samples of a parabola, which the logarithm of a Gaussian is, so that its
    peak may lie between them. Near the ends, the weights of missing samples go to the others.
    """
    step = (
        voxel_position.clamp(0, size - 1)[..., None] - torch.arange(size, device=voxel_position.device)
    ).abs()
    near = (1.5 * step - 2.5) * step**2 + 1
    far = ((2.5 - 0.5 * step) * step - 4) * step + 2
    weights = torch.where(step < 1, near, far) * (step < 2)
    return weights / weights.sum(dim=-1, keepdim=True)
