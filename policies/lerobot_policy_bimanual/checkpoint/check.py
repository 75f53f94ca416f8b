"""Check a checkpoint without running anything that it names.

LeRobot's loader calls any class that a processor file names. It also looks up the names in policies and steps, on the Hub
too, which may bring code of their own. So the files are read as data first. A checkpoint is safe only if its policy, steps
and options are on a list of those that load nothing by name; its weights must be safetensors.
"""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import draccus
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors

import lerobot_policy_bimanual.configurations  # noqa: F401  registers our policies
from lerobot_bimanual.checkpoint_folder import CONFIG_FILE, require_checkpoint
from lerobot_bimanual.errors import BimanualError, plain, shown
from lerobot_bimanual.files import read_json
from lerobot_policy_bimanual.checkpoint.steps import (
    Feature,
    UnverifiableCheckpoint,
    check_classes,
    check_weights,
    options_text,
    step_names,
)
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.keypose.config import LEARNED_LANGUAGE, SELF_CONTAINED, KeyposePolicyConfig

SAFE_POLICIES = {"act", "diffusion", "tdmpc", "vqbet"}
"""Policies of LeRobot that load nothing by name, but weights of torchvision's ResNets."""
LOADED = re.compile("name|path|repo|model|tokenizer|variant|encoder")
"""In the name of an option whose value may be looked up."""
WEIGHTS_FILE = "model.safetensors"
PROCESSOR_FILES = ("policy_preprocessor.json", "policy_postprocessor.json")


class CheckedCheckpoint(NamedTuple):
    """A checkpoint's config, the names of its processor steps by file, and the number of its weights."""

    config: PreTrainedConfig
    steps: dict[str, list[str]]
    parameters: int


def check_checkpoint(folder: Path) -> CheckedCheckpoint:
    """Check the config, the processors and the weights of a checkpoint of this package or of LeRobot.

    The weights of a policy of this package must fit the network of the config. A policy of LeRobot is not built.

    Args:
        folder: a folder `pretrained_model`.

    Raises:
        CheckpointError: something is missing, damaged, unknown or does not fit.
        UnverifiableCheckpoint: a policy, a step or an option may load something by name.
    """
    require_checkpoint(folder)
    try:
        processors = {folder / file: read_json(folder / file) for file in PROCESSOR_FILES}
        for file, processor in processors.items():
            check_classes(file, processor)
        config = _read_config(folder / CONFIG_FILE)
        steps = {file.name: step_names(file, processor) for file, processor in processors.items()}
        expected = None
        if isinstance(config, KeyposePolicyConfig):
            for (file, names), own in zip(steps.items(), make_pre_post_processors(config), strict=True):
                if names != (known := [step["registry_name"] for step in own.get_config()["steps"]]):
                    raise CheckpointError(f"{folder / file} lists the steps {names}, but must list {known}")
            with torch.device("meta"):
                expected = get_policy_class(config.type)(replace(config, compile=False)).state_dict()
        return CheckedCheckpoint(config, steps, check_weights(folder / WEIGHTS_FILE, expected))
    except CheckpointError:
        raise
    except BimanualError as error:  # of a file, or of a config that no network can be made of
        raise CheckpointError(str(error)) from error


def _read_config(file: Path) -> PreTrainedConfig:
    """The config in a file, if it loads nothing by name; nothing is built from it."""
    values = read_json(file)
    if not isinstance(values, dict):
        raise CheckpointError(f"{file} holds {shown(values)}, but must hold an object")
    name = str(values.pop("type", None))
    kind = PreTrainedConfig.get_known_choices().get(name)
    if kind is None or not (name in SAFE_POLICIES or issubclass(kind, KeyposePolicyConfig)):
        looked_up = {
            key: value for key, value in values.items() if isinstance(value, str) and LOADED.search(key)
        }
        raise UnverifiableCheckpoint(f"{file}: the policy {shown(name)}", options_text(looked_up))
    encoder = values.get("language_encoder", LEARNED_LANGUAGE)
    try:
        for side in ("input_features", "output_features"):
            for feature in (values.get(side) or {}).values():
                Feature.from_json(json.dumps(feature))
        config = draccus.decode(kind, values)
        config.validate_features()
    except Exception as error:  # draccus and the configs raise many kinds
        raise CheckpointError(f"{file}: {plain(' '.join(str(error.__cause__ or error).split()))}") from error
    if config.use_peft:
        raise UnverifiableCheckpoint(f"{file}: use_peft is true, and an adapter", "its base")
    if encoder not in SELF_CONTAINED:
        raise UnverifiableCheckpoint(
            f"{file}: the policy {shown(name)}", options_text({"language_encoder": encoder})
        )
    return config
