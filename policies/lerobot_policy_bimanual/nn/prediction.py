"""What a keypose network predicts: one categorical distribution per part of the discrete keypose."""

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import Tensor

from lerobot_bimanual.codec_torch import DiscreteKeypose


@dataclass(frozen=True, eq=False)
class VoxelCandidates:
    """The voxels worth choosing from.

    Attributes:
        voxel: (b, arms, n, 3) int64.
        score: (b, arms, n) log-probability up to a constant; -inf for padding.
    """

    voxel: Tensor
    score: Tensor

    def best(self) -> Tensor:
        """The most probable voxel, (b, arms, 3) int64."""
        index = self.score.argmax(dim=-1)[..., None, None].expand(*self.score.shape[:-1], 1, 3)
        return self.voxel.gather(2, index)[:, :, 0]

    def local_mean(self) -> Tensor:
        """Expected voxel within the 3x3x3 window around the best one, (b, arms, 3) fractional indices."""
        distance = (self.voxel - self.best()[:, :, None]).abs().amax(dim=-1)
        weight = self.score.masked_fill(distance > 1, -torch.inf).softmax(dim=-1)
        return (weight[..., None] * self.voxel).sum(dim=2)


class TranslationPrediction(Protocol):
    """A distribution over voxels for every arm."""

    def cross_entropy(self, voxel: Tensor) -> Tensor:
        """Negative log-likelihood (b, arms) in nats of target voxels (b, arms, 3)."""
        ...

    def candidates(self) -> VoxelCandidates:
        """At least the most probable voxel and what is known of its neighbours."""
        ...


@dataclass(frozen=True, eq=False)
class KeyposePrediction:
    """Distributions over the discrete keypose, as logits; arms in the order of the policy's streams.

    Attributes:
        translation: Distribution over voxels.
        rotation: (b, arms, 3, bins), one distribution per Euler axis.
        gripper_open: (b, arms, 2), class 1 = open.
        ignore_collisions: (b, arms, 2), class 1 = collisions are ignored.
    """

    translation: TranslationPrediction
    rotation: Tensor
    gripper_open: Tensor
    ignore_collisions: Tensor

    def best(self) -> DiscreteKeypose:
        """The most probable class of every part."""
        return DiscreteKeypose(
            voxel=self.translation.candidates().best(),
            rotation=self.rotation.argmax(dim=-1),
            gripper_open=self.gripper_open.argmax(dim=-1),
            ignore_collisions=self.ignore_collisions.argmax(dim=-1),
        )
