"""Config of the policy: importing it registers `--policy.type=blind_mlp`."""

from dataclasses import dataclass, field

from lerobot.configs import NormalizationMode, PreTrainedConfig
from lerobot.optim.optimizers import AdamWConfig


@PreTrainedConfig.register_subclass("blind_mlp")
@dataclass
class BlindMlpConfig(PreTrainedConfig):
    """Sizes and learning rate."""

    push_to_hub: bool = False
    width: int = 256
    lr: float = 1e-3
    # The labels are metres and unit quaternions, and images are not read: nothing is normalised.
    normalization_mapping: dict[str, NormalizationMode] = field(
        default_factory=lambda: dict.fromkeys(("VISUAL", "STATE", "ACTION"), NormalizationMode.IDENTITY)
    )

    observation_delta_indices = action_delta_indices = reward_delta_indices = None

    def get_optimizer_preset(self) -> AdamWConfig:
        """What LeRobot trains with."""
        return AdamWConfig(lr=self.lr)

    def get_scheduler_preset(self) -> None:
        """The learning rate is constant."""
        return None

    def validate_features(self) -> None:
        """Nothing to check: the keys that are read are in every view of our datasets."""
