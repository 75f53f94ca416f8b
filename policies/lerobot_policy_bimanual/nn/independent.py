"""Independent arms: one network per arm, and neither knows what the other is going to do."""

from collections.abc import Callable
from typing import Any

from torch import Tensor, nn

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec_torch import DiscreteKeypose
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction, join_arms, one_arm


class IndependentArms(nn.Module):
    """Predicts each arm's keypose from the scene and that arm's own proprioception.

    Args:
        make_network: Builds a network for one arm from the length of its proprioception, as for
            `LeaderFollower`.
        proprio_dim: Numbers of proprioception per arm.
    """

    def __init__(self, make_network: Callable[[int], nn.Module], *, proprio_dim: int):
        super().__init__()
        self.arms = nn.ModuleList(make_network(proprio_dim) for _ in ARMS)

    def forward(
        self, scene: Any, proprio: Tensor, language: Tensor, target: DiscreteKeypose | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of both arms, left first; arguments as for `LeaderFollower`."""
        bodies = proprio.chunk(len(ARMS), dim=-1)
        return join_arms(
            [
                network(scene, body, language, None if target is None else one_arm(target, arm))
                for arm, network, body in zip(ARMS, self.arms, bodies, strict=True)
            ]
        )
