"""What a keypose network predicts: one categorical distribution per part of the discrete keypose."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.codec_torch import KeyposeBins


@dataclass(frozen=True, eq=False)
class VoxelCandidates:
    """The voxels worth choosing from.

    Attributes:
        voxel: (b, arms, n, 3) int64.
        score: (b, arms, n) log-probability up to a constant; -inf for padding.
        offset: (b, arms, n, 3) where in the voxel the position is expected, in voxels from its centre; None for
            the centre.
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
            voxel: (b, arms, 3) int64, the voxels they lie in.
            offset: (b, arms, 3) where in them, from -0.5 to 0.5 voxels off the centre; None for the centre. Only
                heads that tell cells of a voxel apart look at it.
        """
        ...

    def candidates(self) -> VoxelCandidates:
        """At least the most probable voxel and what is known of its neighbours."""
        ...

    def probabilities(self) -> Tensor:
        """Every voxel's probability (b, arms, v, v, v), to look at: too much for training at full size."""
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
            candidates: those of the translation, by a caller that has asked for them already.
        """
        return KeyposeBins(
            voxel=(candidates or self.translation.candidates()).best(),
            rotation=self.rotation.argmax(dim=-1),
            gripper_open=self.gripper_open.argmax(dim=-1),
            ignore_collisions=self.ignore_collisions.argmax(dim=-1),
        )


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
        parts = [part.candidates() for part in self.parts]
        offsets = [part.offset for part in parts if part.offset is not None]  # all of them or none
        return VoxelCandidates(
            torch.cat([part.voxel for part in parts], dim=1),
            torch.cat([part.score for part in parts], dim=1),
            torch.cat(offsets, dim=1) if offsets else None,
        )

    def probabilities(self) -> Tensor:
        """Every voxel's probability (b, arms, v, v, v)."""
        return torch.cat([part.probabilities() for part in self.parts], dim=1)


def join_arms(predictions: Sequence[KeyposePrediction]) -> KeyposePrediction:
    """One prediction for all arms from one-arm predictions."""
    return KeyposePrediction(
        translation=JointTranslation(tuple(prediction.translation for prediction in predictions)),
        rotation=torch.cat([prediction.rotation for prediction in predictions], dim=1),
        gripper_open=torch.cat([prediction.gripper_open for prediction in predictions], dim=1),
        ignore_collisions=torch.cat([prediction.ignore_collisions for prediction in predictions], dim=1),
    )


def one_arm(keypose: KeyposeBins, arm: Arm) -> KeyposeBins:
    """One arm's bins (b, 1, ...) of both arms' (b, 2, ...)."""
    index = slice(arm.ordinal, arm.ordinal + 1)
    return KeyposeBins(
        keypose.voxel[:, index],
        keypose.rotation[:, index],
        keypose.gripper_open[:, index],
        keypose.ignore_collisions[:, index],
    )
