"""The policy itself."""

from typing import Any

import torch
from lerobot.policies.pretrained import PreTrainedPolicy
from torch import Tensor, nn

from lerobot_bimanual.dataset.schema import ACTION, EE_POSE, KEYPOSE_STEP, VECTORS
from lerobot_bimanual.keypose_layout import KEYPOSE_DIM

from .configuration_blind_mlp import BlindMlpConfig

INPUTS = (EE_POSE, KEYPOSE_STEP)


class BlindMlpPolicy(PreTrainedPolicy):
    """Hands and the number of keyposes so far, to the next keypose."""

    config_class = BlindMlpConfig
    name = "blind_mlp"

    def __init__(self, config: BlindMlpConfig, **kwargs: Any):  # LeRobot passes statistics and metadata, too
        super().__init__(config)
        numbers = sum(len(VECTORS[key]) for key in INPUTS)
        self.network = nn.Sequential(
            nn.Linear(numbers, config.width),
            nn.ReLU(),
            nn.Linear(config.width, config.width),
            nn.ReLU(),
            nn.Linear(config.width, KEYPOSE_DIM),
        )

    def _predict(self, batch: dict[str, Tensor]) -> Tensor:
        rows = len(batch[EE_POSE])  # LeRobot's loader gives a column of single numbers one dimension less
        return self.network(torch.cat([batch[key].reshape(rows, -1) for key in INPUTS], dim=-1))

    def forward(self, batch: dict[str, Tensor]) -> tuple[Tensor, dict[str, float]]:
        """The loss of a batch of the dataset."""
        loss = (self._predict(batch) - batch[ACTION]).abs().mean()
        return loss, {"mean_error": loss.item()}

    def select_action(self, batch: dict[str, Tensor], **kwargs: Any) -> Tensor:
        """18 numbers per row: the environment plans and executes the whole motion, and asks again at its end."""
        return self._predict(batch)

    def predict_action_chunk(self, batch: dict[str, Tensor], **kwargs: Any) -> Tensor:
        """The same as a sequence of one."""
        return self.select_action(batch)[:, None]

    def get_optim_params(self) -> list[Tensor]:
        """What is trained."""
        return list(self.parameters())

    def reset(self) -> None:
        """Nothing is kept: the observation says how far the episode has come."""
