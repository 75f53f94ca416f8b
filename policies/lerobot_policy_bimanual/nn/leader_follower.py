"""Leader and follower: one network per arm; the follower is given the leader's next keypose."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor, nn

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec_torch import KeyposeBins, TorchKeyposeCodec
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction, join_arms, one_arm

KEYPOSE_NUMBERS = 3 + 3 + 1 + 1
"""Numbers of one keypose: position, rotation, gripper flag and collision flag (PerAct2 code)."""


class LeaderFollower(nn.Module):
    """Predicts the leader's keypose, and the follower's given the leader's.

    The leader's keypose, as numbers from -1 to 1, extends the follower's proprioception: the label in training (teacher
    forcing), otherwise the leader's most probable keypose. Bins have no gradient, so none passes between the networks.

    Args:
        make_network: builds a network for one arm, given `proprio_dim`, the length of its proprioception. It is called
            as `network(scene, proprio, language, target)` and returns a `KeyposePrediction` of one arm.
        proprio_dim: numbers of proprioception per arm, without the leader's keypose.
        leader: the arm that decides first.
        codec: the discretisation of keyposes.
    """

    def __init__(
        self,
        make_network: Callable[..., nn.Module],
        *,
        proprio_dim: int,
        leader: Arm,
        codec: TorchKeyposeCodec,
    ):
        super().__init__()
        self.leading_arm = leader
        self.codec = codec
        self.leader = make_network(proprio_dim=proprio_dim)
        self.follower = make_network(proprio_dim=proprio_dim + KEYPOSE_NUMBERS)

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
        plan = self._numbers(targets[leading] or leader.best())
        follower = self.follower(
            scene, torch.cat([bodies[following], plan], dim=-1), language, targets[following]
        )
        predictions = {leading: leader, following: follower}
        return join_arms([predictions[arm] for arm in ARMS])

    def _numbers(self, keypose: KeyposeBins) -> Tensor:
        """One arm's bins (b, 1, ...) as (b, KEYPOSE_NUMBERS) float32 from -1 to 1.

        The reference code gives bare indices, up to 99, and does not augment them with the scene.
        """
        return torch.cat(
            [
                (2 * keypose.voxel + 1) / self.codec.bins.voxels
                - 1,  # the voxel's centre within the workspace
                2 * keypose.rotation / self.codec.bins.rotation_bins - 1,  # the angle in half turns
                2.0 * keypose.gripper_open[..., None] - 1,
                2.0 * keypose.ignore_collisions[..., None] - 1,
            ],
            dim=-1,
        )[:, 0]
