"""Predictions of a keypose network: one categorical distribution per part of the discrete keypose."""

from dataclasses import dataclass
from typing import Protocol, Self

import torch
from torch import Tensor

from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual.nn.precision import at_least_float32


@dataclass(frozen=True, eq=False)
class VoxelCandidates:
    """The most probable voxels.

    Attributes:
        voxel: (b, arms, n, 3) int64.
        score: (b, arms, n) log-probability up to a constant; -inf for padding.
        offset: (b, arms, n, 3) expected position in the voxel, in voxels from its centre; None for the centre.
    """

    voxel: Tensor
    score: Tensor
    offset: Tensor | None = None

    def best(self) -> Tensor:
        """The most probable voxel, (b, arms, 3) int64."""
        index = self.score.argmax(dim=-1)[..., None, None].expand(*self.score.shape[:-1], 1, 3)
        return self.voxel.gather(2, index)[:, :, 0]

    def local_mean(self) -> Tensor:
        """Expected position within the 3x3x3 window around the best one, (b, arms, 3) fractional indices."""
        distance = (self.voxel - self.best()[:, :, None]).abs().amax(dim=-1)
        weight = self.score.masked_fill(distance > 1, -torch.inf).softmax(dim=-1)
        position = self.voxel if self.offset is None else self.voxel + self.offset
        return (weight[..., None] * position).sum(dim=2)


class TranslationPrediction(Protocol):
    """A distribution over voxels for every arm."""

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Negative log-likelihood (b, arms) in nats of targets.

        Args:
            voxel: (b, arms, 3) int64, the target voxels.
            offset: (b, arms, 3) position in them, from -0.5 to 0.5 voxels off the centre; heads may overlook it.
        """
        ...

    def candidates(self) -> VoxelCandidates:
        """Give at least the most probable voxel, and those of its neighbours that were scored."""
        ...

    def probabilities(self) -> Tensor:
        """Probabilities (b, arms, v, v, v) of all voxels, for inspection: too large for training at full size."""
        ...


@dataclass(frozen=True, eq=False)
class KeyposePrediction:
    """Distributions over the discrete keypose, as logits; arms in the order of the policy's streams.

    Attributes:
        translation: distribution over voxels.
        rotation: (b, arms, 3, bins), one distribution per Euler axis.
        gripper_open: (b, arms, 2), class 1 = open.
        ignore_collisions: (b, arms, 2), class 1 = collisions are ignored.
    """

    translation: TranslationPrediction
    rotation: Tensor
    gripper_open: Tensor
    ignore_collisions: Tensor

    @classmethod
    def of_logits(cls, translation: TranslationPrediction, logits: Tensor) -> Self:
        """Split logits (b, arms, 3 bins + 2 + 2) into those of rotation, gripper and collision flag, at least float32."""
        sizes = (logits.shape[-1] - 4, 2, 2)
        rotation, gripper_open, ignore_collisions = at_least_float32(logits).split(sizes, dim=-1)
        return cls(translation, rotation.unflatten(-1, (3, -1)), gripper_open, ignore_collisions)

    def best(self) -> KeyposeBins:
        """The most probable class of every part, and the expected position around the voxel; none has a gradient."""
        candidates = self.translation.candidates()
        return KeyposeBins(
            voxel=candidates.best(),
            rotation=self.rotation.argmax(dim=-1),
            gripper_open=self.gripper_open.argmax(dim=-1),
            ignore_collisions=self.ignore_collisions.argmax(dim=-1),
            voxel_position=candidates.local_mean().detach(),
        )


def neighbours(voxel: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """Voxels (..., 27, 3) around voxels (..., 3), themselves included, and which (..., 27) are in the grid."""
    step = torch.arange(-1, 2, device=voxel.device)
    around = voxel[..., None, :] + torch.cartesian_prod(step, step, step)
    return around, ((around >= 0) & (around < size)).all(dim=-1)
