"""RVT in two stages, coarse and fine, as in RVT-2 (Goyal et al., 2024, https://arxiv.org/abs/2406.08545)."""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction, VoxelCandidates
from lerobot_policy_bimanual.rvt_lf.configuration_rvt_lf import RVTLFConfig
from lerobot_policy_bimanual.rvt_lf.heatmaps import HeatmapTranslation, ProductTranslation
from lerobot_policy_bimanual.rvt_lf.network import RVTNetwork
from lerobot_policy_bimanual.rvt_lf.scene import Scene
from lerobot_policy_bimanual.rvt_lf.views import magnified

JITTER = 0.75
"""Largest distance of the label from the middle of zoomed-in views in training, along each axis, in half edges of a view."""


class StagedRVT(nn.Module):
    """Predicts one arm's keypose by one RVT or, with `fine_stage_zoom`, by two.

    The coarse stage sees the whole workspace. The fine stage sees the surroundings of the position that the coarse one
    predicts; in training, those of the label, off their middle at random. The fine stage gives the position. The logits of
    rotation, gripper and flag of both are added.

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
            label = target.voxel[:, 0].float()
            middle = label + JITTER * self.half_view * (2 * torch.rand_like(label) - 1)
        else:
            middle = coarse.translation.candidates().local_mean()[:, 0]
        # All of the view is within the workspace, so that the position is.
        border = self.half_view - 0.5
        middle = middle.clamp(border, self.last_voxel - border)
        fine = self.fine(scene.zoomed_in(middle), proprio, language)
        return KeyposePrediction(
            FineTranslation(coarse.translation, fine.translation, middle[:, None], self.zoom),
            coarse.rotation + fine.rotation,
            coarse.gripper_open + fine.gripper_open,
            coarse.ignore_collisions + fine.ignore_collisions,
        )


@dataclass(frozen=True, eq=False)
class FineTranslation:
    """Distributions over the voxels of the workspace, and over finer ones around a position, which decide.

    Attributes:
        coarse: over the workspace.
        fine: over the zoomed-in surroundings.
        middle: (b, 1, 3) the middle of the surroundings, in coarse voxels.
        zoom: fine voxels per coarse voxel, along each axis.
    """

    coarse: HeatmapTranslation | ProductTranslation
    fine: HeatmapTranslation | ProductTranslation
    middle: Tensor
    zoom: int

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Sum (b, 1) of the cross-entropies of both stages; targets outside the surroundings count as at their border."""
        size = self.fine.logits.shape[-1]
        place = magnified(voxel + offset, self.middle, self.zoom, size).clamp(0, size - 1)
        fine = place.round()
        return self.coarse.cross_entropy(voxel, offset) + self.fine.cross_entropy(fine.long(), place - fine)

    def candidates(self) -> VoxelCandidates:
        """The candidates of the fine stage, in coarse voxels."""
        found = self.fine.candidates()
        place = self._places(found.voxel, self.middle[:, :, None])
        voxel = place.round().long()
        return VoxelCandidates(voxel, found.score, place - voxel)

    def probabilities(self) -> Tensor:
        """Probabilities (b, 1, v, v, v) of the coarse voxels: those of the best fine voxel in each, scaled to add up to 1."""
        fine = self.fine.probabilities()
        size = fine.shape[-1]
        axis = torch.arange(size, device=fine.device)[:, None]
        x, y, z = self._places(axis, self.middle).round().long().unbind(2)  # (b, v) each
        voxel = (x[:, :, None, None] * size + y[:, None, :, None]) * size + z[:, None, None]
        best = torch.zeros_like(fine.flatten(1)).scatter_reduce_(1, voxel.flatten(1), fine.flatten(1), "amax")
        return (best / best.sum(dim=1, keepdim=True)).view_as(fine)

    def _places(self, fine: Tensor, middle: Tensor) -> Tensor:
        """Where fine voxels (..., 3) lie among the coarse ones, around middles (..., 3)."""
        return middle + (fine - (self.fine.logits.shape[-1] - 1) / 2) / self.zoom
