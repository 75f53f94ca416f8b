"""PerAct2: a Perceiver-Actor for two arms.

Grotz et al., "PerAct2: Benchmarking and Learning for Robotic Bimanual Manipulation Tasks", 2024
(https://arxiv.org/abs/2407.00278).
"""

from lerobot_bimanual.arms import ARMS
from lerobot_policy_bimanual.keypose.observation import PROPRIO_PER_ARM
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.policy import PerActPolicy
from lerobot_policy_bimanual.peract2.configuration_peract2 import PerAct2Config


class PerAct2Policy(PerActPolicy):
    """Voxels in, the next keypose of both arms out, from one network."""

    config: PerAct2Config  # pyright: ignore[reportIncompatibleVariableOverride]
    config_class = PerAct2Config  # pyright: ignore[reportAssignmentType]
    name = "peract2"  # pyright: ignore[reportAssignmentType]

    def make_network(self) -> PerActNetwork:
        """One network for both arms."""
        return PerActNetwork(
            self.config,
            arms=len(ARMS),
            proprio_dim=len(ARMS) * PROPRIO_PER_ARM,
            joint=self.config.joint_decoding,
        )
