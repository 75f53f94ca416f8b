"""One look at the whole workspace and a second one from nearer, as in RVT-2 (Goyal et al., 2024, arXiv 2406.08545)."""

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

JITTER = 0.25
"""How far the label is off the middle of the second look in training, at most and along each axis, in half edges of the view."""


class Looks(nn.Module):
    """Predicts one arm's keypose by one RVT or, with `second_look_zoom`, by two.

    The first sees the whole workspace. The second sees the surroundings of the place that the first chose, in training
    those of the label, moved at random. Its heatmaps say the position; the logits of all else are added up.

    Args:
        config: all sizes.
        **sizes: those of the proprioception and of the goal's mark, as for `RVTNetwork`.
    """

    def __init__(self, config: RVTLFConfig, **sizes: int):
        super().__init__()
        self.reach = JITTER * config.voxel_size / 2 / config.second_look_zoom
        self.zoom = config.second_look_zoom
        self.first = RVTNetwork(config, **sizes)
        self.second = RVTNetwork(config, **sizes) if self.zoom > 1 else None

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
        first = self.first(scene.whole, proprio, language)
        if self.second is None:
            return first
        if self.training and target is not None:
            middle = target.voxel[:, 0] + self.reach * (2 * torch.rand_like(target.voxel[:, 0].float()) - 1)
        else:
            middle = first.translation.candidates().local_mean()[:, 0]
        second = self.second(scene.closer(middle), proprio, language)
        return KeyposePrediction(
            TwoHeatmaps(first.translation, second.translation, middle[:, None], self.zoom),
            first.rotation + second.rotation,
            first.gripper_open + second.gripper_open,
            first.ignore_collisions + second.ignore_collisions,
        )


@dataclass(frozen=True, eq=False)
class TwoHeatmaps:
    """Distributions over the voxels of the workspace, and over finer ones around a place.

    Attributes:
        first: of the whole workspace.
        second: of the magnified surroundings.
        middle: (b, 1, 3) the middle of these surroundings, in voxels of the workspace.
        zoom: voxels of the surroundings per voxel of the workspace, along each axis.
    """

    first: HeatmapTranslation | ProductTranslation
    second: HeatmapTranslation | ProductTranslation
    middle: Tensor
    zoom: int

    def cross_entropy(self, voxel: Tensor, offset: Tensor | None = None) -> Tensor:
        """Sum (b, 1) of the cross-entropies of both; targets outside the surroundings count as at their border."""
        V = self.second.logits.shape[-1]
        place = magnified(voxel if offset is None else voxel + offset, self.middle, self.zoom, V).clamp(
            0, V - 1
        )
        near = place.round()
        return self.first.cross_entropy(voxel, offset) + self.second.cross_entropy(near.long(), place - near)

    def candidates(self) -> VoxelCandidates:
        """The candidates of the second, in voxels of the workspace."""
        V = self.second.logits.shape[-1]
        found = self.second.candidates()
        place = self.middle[:, :, None] + (found.voxel - (V - 1) / 2) / self.zoom
        voxel = place.round().long().clamp(0, V - 1)
        return VoxelCandidates(voxel, found.score, place - voxel)

    def probabilities(self) -> Tensor:
        """Probabilities (b, 1, v, v, v) of the first."""
        return self.first.probabilities()
