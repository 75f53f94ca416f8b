"""Config of PerAct2."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig

from lerobot_policy_bimanual.keypose.fields import require_multiple
from lerobot_policy_bimanual.peract.config import PerActConfig


@PreTrainedConfig.register_subclass("peract2")
@dataclass
class PerAct2Config(PerActConfig):
    """PerAct2: one Perceiver IO over voxels for both arms."""

    # Decode the right arm's position given the left one's. Without it the arms choose independently of each other, as in
    # the paper.
    joint_decoding: bool = False

    def __post_init__(self):
        """Refuse latents that two arms cannot share."""
        super().__post_init__()
        require_multiple(self, "num_latents", 2, "the arms share the latents evenly")
