"""What `lerobot-eval` does with a policy's actions before the environment gets them."""

from dataclasses import dataclass

from lerobot.configs import PipelineFeatureType, PolicyFeature
from lerobot.processor import PolicyActionProcessorStep
from torch import Tensor

from lerobot_bimanual.joint_action import JOINT_ACTION_DIM

PARTS = 4096
"""Steps of one radian, and of a gripper's full opening. In 1762 poses that ACT commanded, rounding moves the fingertips by
0.07 mm in the mean, 0.19 mm at most; a Panda repeats a position within 0.1 mm (its data sheet)."""


@dataclass
class RoundJointActions(PolicyActionProcessorStep):
    """Rounds joint actions (n, 16) to multiples of 1 / 4096; other actions stay as they are.

    A network's last bits are noise that cannot be compressed. Without them a result, which holds every action, takes about
    40 % fewer bytes.
    """

    def action(self, action: Tensor) -> Tensor:
        """Joint actions (n, 16), rounded, or keyposes (n, 18), unchanged."""
        if action.shape[-1] != JOINT_ACTION_DIM:
            return action
        return (action * PARTS).round() / PARTS

    def transform_features(
        self, features: dict[PipelineFeatureType, dict[str, PolicyFeature]]
    ) -> dict[PipelineFeatureType, dict[str, PolicyFeature]]:
        """Shapes stay."""
        return features
