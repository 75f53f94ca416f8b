"""PerAct2: a Perceiver-Actor for two arms.

Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278).
"""

from typing import Any

from lerobot_bimanual.arms import ARMS
from lerobot_policy_bimanual.peract2.configuration_peract2 import PerAct2Config
from lerobot_policy_bimanual.peract_policy import PerActPolicy, make_network
from lerobot_policy_bimanual.processing import PROPRIO_PER_ARM


class PerAct2Policy(PerActPolicy):
    """Voxels in, the next keypose of both arms out, from one network."""

    config: PerAct2Config  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerAct2Config  # pyright: ignore[reportAssignmentType]
    name = "peract2"  # pyright: ignore[reportAssignmentType]

    def __init__(self, config: PerAct2Config, **kwargs: Any):
        super().__init__(config, **kwargs)
        self.network = make_network(config, arms=len(ARMS), proprio_dim=len(ARMS) * PROPRIO_PER_ARM)
