"""Check a checkpoint without running anything that it names.

LeRobot's loader calls whatever class a processor file names. So the files are read as data first: the policy type and
the processor steps must be registered by LeRobot or by this package, and the weights must be safetensors.
"""

import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import draccus
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.processor import ProcessorStepRegistry
from torch import Tensor

import lerobot_policy_bimanual.configurations  # noqa: F401  registers our policies
from lerobot_bimanual.errors import BimanualError
from lerobot_policy_bimanual.checkpoint.folder import CONFIG_FILE, require_checkpoint
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.keypose.config import LEARNED_LANGUAGE, KeyposePolicyConfig
from lerobot_policy_bimanual.keypose.weights import check_weights

MAX_JSON_BYTES = 2**24
KNOWN_PACKAGES = ("lerobot", "lerobot_policy_bimanual")
WEIGHTS_FILE = "model.safetensors"
PROCESSOR_FILES = ("policy_preprocessor.json", "policy_postprocessor.json")
SUBTASK_STEP = {"class": "lerobot_policy_bimanual.training.subtask_step.SubtaskStep", "config": {}}
"""The one step that is allowed by class: registering it would make every plugin discovery import LeRobot's processors."""


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
    """
    config = read_config(folder)
    expected = _weights_of(config) if isinstance(config, KeyposePolicyConfig) else None
    try:
        importlib.import_module(type(config).__module__.replace("configuration_", "processor_"))
    except ImportError as error:
        raise CheckpointError(f"LeRobot's policy {config.type} is not fully installed: {error}") from error
    steps = {file: step_names(folder / file) for file in PROCESSOR_FILES}
    if expected is not None:
        for (file, names), own in zip(steps.items(), make_pre_post_processors(config), strict=True):
            if names != (known := [step["registry_name"] for step in own.get_config()["steps"]]):
                raise CheckpointError(f"{folder / file} lists the steps {names}, but must list {known}")
    return CheckedCheckpoint(config, steps, check_weights(folder / WEIGHTS_FILE, expected))


def read_config(folder: Path) -> PreTrainedConfig:
    """Read the config of a folder `pretrained_model`; nothing is built from it.

    Raises:
        CheckpointError: there is no config, its policy is not known, or a field is unknown, of another type or out of
            its range.
    """
    require_checkpoint(folder)
    file = folder / CONFIG_FILE
    values = _read_object(file)
    known = {
        name: kind
        for name, kind in PreTrainedConfig.get_known_choices().items()
        if kind.__module__.partition(".")[0] in KNOWN_PACKAGES
    }
    kind = known.get(str(values.pop("type", None)))
    if kind is None:
        raise CheckpointError(f"{file} names no known policy type; known are {', '.join(sorted(known))}")
    try:
        config = draccus.decode(kind, values)
        if isinstance(config, KeyposePolicyConfig):
            config.validate_features()
    except Exception as error:  # draccus and the configs raise many kinds
        raise CheckpointError(f"{file}: {' '.join(str(error.__cause__ or error).split())}") from error
    if config.use_peft:
        raise CheckpointError(f"{file}: use_peft is true, but adapters cannot be checked")
    return config


def _read_object(file: Path) -> dict[str, Any]:
    if not file.is_file():
        raise CheckpointError(f"{file} does not exist: the checkpoint is incomplete")
    if file.stat().st_size > MAX_JSON_BYTES:
        raise CheckpointError(f"{file} is larger than {MAX_JSON_BYTES >> 20} MB")
    try:
        value = json.loads(file.read_bytes())
    except (ValueError, RecursionError) as error:
        raise CheckpointError(f"{file} must be JSON: {error}") from error
    if not isinstance(value, dict):
        raise CheckpointError(f"{file} holds a {type(value).__name__}, but must hold an object")
    return value


def step_names(file: Path) -> list[str]:
    """Read the names of the steps of a processor file, and check the tensors that the steps name.

    Raises:
        CheckpointError: the file is missing or malformed, or names a class or a step from elsewhere.
    """
    steps = _read_object(file).get("steps")
    if not isinstance(steps, list) or not all(isinstance(step, dict) for step in steps):
        raise CheckpointError(f"{file} has no list of steps")
    for step in steps:
        if step == SUBTASK_STEP:
            continue
        if "class" in step:
            raise CheckpointError(
                f"{file} names the class {step['class']!r}, which LeRobot's loader would call. Do not load this checkpoint"
            )
        name, state = str(step.get("registry_name")), step.get("state_file")
        known = name in ProcessorStepRegistry.list() and ProcessorStepRegistry.get(name).__module__
        if not known or known.partition(".")[0] != "lerobot":
            raise CheckpointError(f"{file} names the step {name!r}, which LeRobot does not have")
        if state is not None:
            if Path(str(state)).name != state:
                raise CheckpointError(
                    f"{file} names the state file {state!r}, which is not in the same folder"
                )
            check_weights(file.parent / state)
    return [step.get("registry_name", "SubtaskStep") for step in steps]


def _weights_of(config: KeyposePolicyConfig) -> dict[str, Tensor]:
    """The weights of a policy by name, as tensors without memory."""
    # A frozen text tower is not among the weights, and must not be loaded here.
    stand_in = replace(config, language_encoder=LEARNED_LANGUAGE)
    try:
        with torch.device("meta"):
            weights = get_policy_class(config.type)(stand_in).state_dict()
    except BimanualError as error:
        raise CheckpointError(str(error)) from error
    learned = config.language_encoder == LEARNED_LANGUAGE
    return {name: weight for name, weight in weights.items() if learned or not name.startswith("language.")}
