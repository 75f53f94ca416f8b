"""What the PerAct variants have in common: voxels in."""

from torch import Tensor

from lerobot_policy_bimanual.keypose.observation import Observation
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.peract.config import PerActConfig
from lerobot_policy_bimanual.peract.voxel_grid import voxelise


class PerActPolicy(KeyposePolicy):
    """A keypose policy whose network sees voxels."""

    config: PerActConfig  # pyright: ignore[reportIncompatibleVariableOverride]

    def scene(self, observation: Observation) -> Tensor:
        """The voxel grid (b, 10, v, v, v)."""
        return voxelise(
            observation.points,
            observation.colours,
            workspace=self.config.workspace,
            voxels=self.config.voxel_size,
        )
