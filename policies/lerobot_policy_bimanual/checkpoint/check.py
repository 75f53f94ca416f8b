"""Look at a whole checkpoint without running anything that it names."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import torch
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from torch import Tensor

from lerobot_bimanual.errors import BimanualError
from lerobot_policy_bimanual.checkpoint.config_file import read_config
from lerobot_policy_bimanual.checkpoint.processors import (
    POSTPROCESSOR,
    PREPROCESSOR,
    check_processors,
    register_steps_of,
)
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.keypose.config import LEARNED_LANGUAGE, KeyposePolicyConfig
from lerobot_policy_bimanual.keypose.weights import WeightCount, check_weights

WEIGHTS_FILE = "model.safetensors"


@dataclass(frozen=True)
class CheckedCheckpoint:
    """What a checkpoint holds, found out by reading.

    Attributes:
        folder: where it is.
        config: its config.
        steps: names of processor steps by file.
        weights: how many weights, of which kind.
    """

    folder: Path
    config: PreTrainedConfig
    steps: dict[str, list[str]]
    weights: WeightCount


def check_checkpoint(folder: Path) -> CheckedCheckpoint:
    """Check the config, the processors and the weights of a checkpoint, one of ours or of LeRobot's own policies.

    For ours the weights must be those of the network that the config describes. For LeRobot's own policies that is not
    checked, as it would mean to build them.

    Args:
        folder: a folder `pretrained_model`.

    Raises:
        CheckpointError: something is missing, damaged, unknown or does not fit.
    """
    config = read_config(folder)
    if isinstance(config, KeyposePolicyConfig):
        try:
            expected = _expected_weights(config)
        except BimanualError as error:
            raise CheckpointError(f"{folder}: {error}") from error
        steps = check_processors(folder, _own_steps(config))
        return CheckedCheckpoint(folder, config, steps, check_weights(folder / WEIGHTS_FILE, expected))
    try:
        register_steps_of(config)
    except ImportError as error:
        raise CheckpointError(
            f"LeRobot's policy {config.type} is not installed completely: {error}"
        ) from error
    steps = check_processors(folder, None)
    return CheckedCheckpoint(folder, config, steps, check_weights(folder / WEIGHTS_FILE))


def _expected_weights(config: KeyposePolicyConfig) -> dict[str, Tensor]:
    """The weights of a policy by name, as tensors without memory."""
    # A frozen language tower is not among the weights, and is not to be loaded to look at them.
    stand_in = replace(config, language_encoder=LEARNED_LANGUAGE)
    with torch.device("meta"):
        weights = get_policy_class(config.type)(stand_in).state_dict()
    learned = config.language_encoder == LEARNED_LANGUAGE
    return {name: weight for name, weight in weights.items() if learned or not name.startswith("language.")}


def _own_steps(config: KeyposePolicyConfig) -> dict[str, list[dict]]:
    """The steps that a policy of ours has by itself."""
    return {
        file: cast(list[dict], pipeline.get_config()["steps"])
        for file, pipeline in zip(
            (PREPROCESSOR, POSTPROCESSOR), make_pre_post_processors(config), strict=True
        )
    }
