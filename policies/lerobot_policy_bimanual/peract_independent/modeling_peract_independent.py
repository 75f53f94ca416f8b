"""Independent PerAct: two Perceiver-Actors that see the same cloud.

The pair without coordination in the code of Grotz et al., "PerAct2: Benchmarking and Learning for Robotic
Bimanual Manipulation Tasks", 2024 (https://arxiv.org/abs/2407.00278), made of PerAct (Shridhar et al., 2022,
https://arxiv.org/abs/2209.05451).
"""

from functools import partial

from lerobot_policy_bimanual.keypose.observation import PROPRIO_PER_ARM
from lerobot_policy_bimanual.nn.arms import IndependentArms
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.policy import PerActPolicy
from lerobot_policy_bimanual.peract_independent.configuration_peract_independent import (
    PerActIndependentConfig,
)


class PerActIndependentPolicy(PerActPolicy):
    """Voxels and an arm's own proprioception in, that arm's next keypose out, from one network per arm."""

    config: PerActIndependentConfig  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerActIndependentConfig  # pyright: ignore[reportAssignmentType]
    name = "peract_independent"  # pyright: ignore[reportAssignmentType]

    def make_network(self) -> IndependentArms:
        """One network per arm."""
        return IndependentArms(partial(PerActNetwork, self.config, arms=1), proprio_dim=PROPRIO_PER_ARM)
