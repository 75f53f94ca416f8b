"""Independent PerAct: two Perceiver-Actors that see the same cloud.

The pair without coordination in the code of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic
Bimanual Manipulation Tasks", 2024 (https://arxiv.org/abs/2407.00278), made of PerAct (Shridhar et al., 2022,
https://arxiv.org/abs/2209.05451).
"""

from typing import Any

from lerobot_policy_bimanual.nn.independent import IndependentArms
from lerobot_policy_bimanual.peract_independent.configuration_peract_independent import (
    PerActIndependentConfig,
)
from lerobot_policy_bimanual.peract_policy import PerActPolicy, make_network
from lerobot_policy_bimanual.processing import PROPRIO_PER_ARM


class PerActIndependentPolicy(PerActPolicy):
    """Voxels and an arm's own proprioception in, that arm's next keypose out, from one network per arm."""

    config: PerActIndependentConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerActIndependentConfig  # pyright: ignore[reportAssignmentType]
    name = "peract_independent"  # pyright: ignore[reportAssignmentType]

    def __init__(self, config: PerActIndependentConfig, **kwargs: Any):
        super().__init__(config, **kwargs)
        self.network = IndependentArms(
            lambda proprio_dim: make_network(config, arms=1, proprio_dim=proprio_dim),
            proprio_dim=PROPRIO_PER_ARM,
        )
