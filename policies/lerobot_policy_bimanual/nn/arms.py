"""One network per arm: independent ones, and a follower that is given the leader's next keypose."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, cast

import torch
from torch import Tensor, nn

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec_torch import KeyposeBins, TorchKeyposeCodec
from lerobot_policy_bimanual.nn.precision import full_precision
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction, TranslationPrediction, VoxelCandidates

KEYPOSE_NUMBERS = 3 + 3 + 1 + 1
"""Numbers of one keypose: position, rotation, gripper flag and collision flag (PerAct2 code)."""


class IndependentArms(nn.Module):
    """Predicts each arm's keypose from the scene and that arm's own proprioception; arguments as for `LeaderFollower`."""

    def __init__(self, make_network: Callable[..., nn.Module], *, proprio_dim: int):
        super().__init__()
        self.arms = nn.ModuleList(make_network(proprio_dim=proprio_dim) for _ in ARMS)

    def forward(
        self, scene: Any, proprio: Tensor, language: Tensor, target: KeyposeBins | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of both arms, left first."""
        bodies = proprio.chunk(len(ARMS), dim=-1)
        return join_arms(
            [
                network(scene, body, language, None if target is None else one_arm(target, arm))
                for arm, network, body in zip(ARMS, self.arms, bodies, strict=True)
            ]
        )


class LeaderFollower(nn.Module):
    """Predicts the leader's keypose, and the follower's given the leader's.

    The leader's keypose, as numbers from -1 to 1, extends the follower's proprioception: the label in training (teacher
    forcing), otherwise the leader's most probable keypose. Neither has a gradient, so none passes between the networks. The
    position is not rounded to voxels: for a label at the border of two, an accurate prediction could be a whole voxel off.
    With `mark`, the follower also sees in its scene where the leader goes.

    Args:
        make_network: builds a network for one arm, given `proprio_dim`, the length of its proprioception. It is called
            as `network(scene, proprio, language, target)` and returns a `KeyposePrediction` of one arm.
        proprio_dim: numbers of proprioception per arm, without the leader's keypose.
        leader: the arm that decides first.
        codec: the discretisation of keyposes.
        mark: adds a channel to a scene that marks positions (b, 3) in voxels, see `gaussian_1d`; `make_network` then also gets
            `goal_channels=1`. None for the paper's follower, which has the numbers only.
    """

    def __init__(
        self,
        make_network: Callable[..., nn.Module],
        *,
        proprio_dim: int,
        leader: Arm,
        codec: TorchKeyposeCodec,
        mark: Callable[[Any, Tensor], Any] | None = None,
    ):
        super().__init__()
        self.leading_arm = leader
        self.codec = codec
        self.mark = mark
        self.leader = make_network(proprio_dim=proprio_dim)
        goal = {} if mark is None else {"goal_channels": 1}
        self.follower = make_network(proprio_dim=proprio_dim + KEYPOSE_NUMBERS, **goal)

    def forward(
        self, scene: Any, proprio: Tensor, language: Tensor, target: KeyposeBins | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of both arms.

        Args:
            scene: input of both networks.
            proprio: (b, 2 proprio_dim), left arm first.
            language: (b, tokens, dim).
            target: label of both arms in training, augmented as the scene is; None at inference.

        Returns:
            Both arms, left first.
        """
        leading, following = self.leading_arm, self.leading_arm.other
        bodies = dict(zip(ARMS, proprio.chunk(len(ARMS), dim=-1), strict=True))
        targets = {arm: None if target is None else one_arm(target, arm) for arm in ARMS}
        leader = self.leader(scene, bodies[leading], language, targets[leading])
        # In half precision a position would be rounded to parts of a voxel.
        with full_precision(proprio.device):
            goal = targets[leading] or leader.best()
        follower_proprio = torch.cat([bodies[following], self._numbers(goal)], dim=-1)
        follower_scene = scene if self.mark is None else self.mark(scene, goal.voxel_position[:, 0])
        follower = self.follower(follower_scene, follower_proprio, language, targets[following])
        predictions = {leading: leader, following: follower}
        return join_arms([predictions[arm] for arm in ARMS])

    def _numbers(self, keypose: KeyposeBins) -> Tensor:
        """One arm's keypose (b, 1, ...) as (b, KEYPOSE_NUMBERS) float32 from -1 to 1.

        The reference code gives bare indices of bins, up to 99, and does not augment them with the scene.
        """
        return torch.cat(
            [
                (2 * keypose.voxel_position + 1) / self.codec.voxels - 1,  # within the workspace
                2 * keypose.rotation / self.codec.rotation_bins - 1,  # the angle in half turns
                2.0 * keypose.gripper_open[..., None] - 1,
                2.0 * keypose.ignore_collisions[..., None] - 1,
            ],
            dim=-1,
        )[:, 0]


@dataclass(frozen=True, eq=False)
class JointTranslation:
    """Distributions of several one-arm networks as one.

    Attributes:
        parts: one distribution per arm, each over (b, 1, ...), with equally many candidates.
    """

    parts: tuple[TranslationPrediction, ...]

    def cross_entropy(self, voxel: Tensor, offset: Tensor) -> Tensor:
        """Negative log-likelihood (b, arms) of targets in voxels (b, arms, 3)."""
        parts = zip(self.parts, voxel.split(1, dim=1), offset.split(1, dim=1), strict=True)
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
