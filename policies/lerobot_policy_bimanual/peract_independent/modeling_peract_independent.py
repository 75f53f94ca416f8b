"""Independent PerAct: two Perceiver-Actors that see the same cloud.

The pair without coordination in the code of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic
Bimanual Manipulation Tasks", 2024 (https://arxiv.org/abs/2407.00278), made of PerAct (Shridhar et al., 2022,
https://arxiv.org/abs/2209.05451).
"""

from torch import Tensor, nn

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual.keypose.observation import PROPRIO_PER_ARM
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction, join_arms, one_arm
from lerobot_policy_bimanual.peract.config import PerActConfig
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.policy import PerActPolicy
from lerobot_policy_bimanual.peract_independent.configuration_peract_independent import (
    PerActIndependentConfig,
)


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
        self, grid: Tensor, proprio: Tensor, language: Tensor, target: KeyposeBins | None = None
    ) -> KeyposePrediction:
        """Predict the next keypose of both arms, left first; arguments as for `PerActNetwork`."""
        bodies = proprio.chunk(len(ARMS), dim=-1)
        return join_arms(
            [
                network(grid, body, language, None if target is None else one_arm(target, arm))
                for arm, network, body in zip(ARMS, self.arms, bodies, strict=True)
            ]
        )


class PerActIndependentPolicy(PerActPolicy):
    """Voxels and an arm's own proprioception in, that arm's next keypose out, from one network per arm."""

    config: PerActIndependentConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerActIndependentConfig  # pyright: ignore[reportAssignmentType]
    name = "peract_independent"  # pyright: ignore[reportAssignmentType]

    def make_network(self) -> IndependentArms:
        """One network per arm."""
        return IndependentArms(self.config, proprio_dim=PROPRIO_PER_ARM)
