"""Predictions of a keypose network: one categorical distribution per part of the discrete keypose."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol, cast

import torch
from torch import Tensor

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.codec_torch import KeyposeBins


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

    def cross_entropy(self, voxel: Tensor, offset: Tensor | None = None) -> Tensor:
        """Negative log-likelihood (b, arms) in nats of targets.

        Args:
            voxel: (b, arms, 3) int64, the target voxels.
            offset: (b, arms, 3) position in them, from -0.5 to 0.5 voxels off the centre; None for the centre. Only
                heads with sub-voxel bins use it.
        """
        ...

    def candidates(self) -> VoxelCandidates:
        """Give at least the most probable voxel and its neighbours."""
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

    def best(self, candidates: VoxelCandidates | None = None) -> KeyposeBins:
        """The most probable class of every part.

        Args:
            candidates: candidates of the translation, if the caller has computed them already.
        """
        return KeyposeBins(
            voxel=(candidates or self.translation.candidates()).best(),
            rotation=self.rotation.argmax(dim=-1),
            gripper_open=self.gripper_open.argmax(dim=-1),
            ignore_collisions=self.ignore_collisions.argmax(dim=-1),
        )


def neighbours(voxel: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """Voxels (..., 27, 3) around voxels (..., 3), themselves included, and which (..., 27) are in the grid."""
    step = torch.arange(-1, 2, device=voxel.device)
    around = voxel[..., None, :] + torch.cartesian_prod(step, step, step)
    return around, ((around >= 0) & (around < size)).all(dim=-1)


@dataclass(frozen=True, eq=False)
class JointTranslation:
    """Distributions of several one-arm networks as one.

    Attributes:
        parts: one distribution per arm, each over (b, 1, ...), with equally many candidates.
    """

    parts: tuple[TranslationPrediction, ...]

    def cross_entropy(self, voxel: Tensor, offset: Tensor | None = None) -> Tensor:
        """Negative log-likelihood (b, arms) of targets in voxels (b, arms, 3)."""
        voxels = voxel.split(1, dim=1)
        offsets = [None] * len(voxels) if offset is None else offset.split(1, dim=1)
        parts = zip(self.parts, voxels, offsets, strict=True)
        return torch.cat([part.cross_entropy(inside, where) for part, inside, where in parts], dim=1)

    def candidates(self) -> VoxelCandidates:
        """The candidates of all arms."""
        return _joined([part.candidates() for part in self.parts])

    def probabilities(self) -> Tensor:
        """Probabilities (b, arms, v, v, v) of all voxels."""
        return torch.cat([part.probabilities() for part in self.parts], dim=1)


def join_arms(predictions: Sequence[KeyposePrediction]) -> KeyposePrediction:
    """Join one-arm predictions to one for all arms."""
    # Not one tensor of all logits: the softmax of a CPU rounds another way for another number of rows.
    translation = JointTranslation(tuple(prediction.translation for prediction in predictions))
    return _joined([replace(prediction, translation=translation) for prediction in predictions])


def _joined[T](parts: Sequence[T]) -> T:
    """One dataclass of several, with their tensors concatenated along axis 1, the arms, and all else of the first."""
    joined = {}
    for field in fields(cast(Any, parts[0])):
        values = [getattr(part, field.name) for part in parts]
        joined[field.name] = torch.cat(values, dim=1) if isinstance(values[0], Tensor) else values[0]
    return type(parts[0])(**joined)


def one_arm(keypose: KeyposeBins, arm: Arm) -> KeyposeBins:
    """One arm's bins (b, 1, ...) of both arms' (b, 2, ...)."""
    index = slice(arm.ordinal, arm.ordinal + 1)
    return KeyposeBins(*(getattr(keypose, field.name)[:, index] for field in fields(keypose)))
