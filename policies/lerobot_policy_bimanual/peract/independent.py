"""Independent arms: one network per arm, and neither knows what the other is going to do."""

from torch import Tensor, nn

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec_torch import DiscreteKeypose
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction, join_arms, one_arm
from lerobot_policy_bimanual.peract.config import PerActConfig
from lerobot_policy_bimanual.peract.network import PerActNetwork


class IndependentArms(nn.Module):
    """Predicts each arm's keypose from the scene and that arm's own proprioception.

    Args:
        config: sizes of both networks.
        proprio_dim: numbers of proprioception per arm.
    """

    def __init__(self, config: PerActConfig, *, proprio_dim: int):
        super().__init__()
        self.arms = nn.ModuleList(PerActNetwork(config, arms=1, proprio_dim=proprio_dim) for _ in ARMS)

    def forward(
        self, grid: Tensor, proprio: Tensor, language: Tensor, target: DiscreteKeypose | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of both arms, left first; arguments as for `PerActNetwork`."""
        bodies = proprio.chunk(len(ARMS), dim=-1)
        return join_arms(
            [
                network(grid, body, language, None if target is None else one_arm(target, arm))
                for arm, network, body in zip(ARMS, self.arms, bodies, strict=True)
            ]
        )
