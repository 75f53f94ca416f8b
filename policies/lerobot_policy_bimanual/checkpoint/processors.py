"""Processor files of a checkpoint: which steps they name.

LeRobot's loader calls whatever class such a file names, and only then looks at what it got; so a step is a registered
name here, or the one class of ours that has none.
"""

import importlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

from lerobot.configs import PreTrainedConfig
from lerobot.processor import ProcessorStepRegistry

from lerobot_policy_bimanual.checkpoint.config_file import read_object
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.keypose.weights import check_weights

PREPROCESSOR, POSTPROCESSOR = "policy_preprocessor.json", "policy_postprocessor.json"
STEP_KEYS = {"registry_name", "config", "state_file"}
OWN_CLASS = "lerobot_policy_bimanual.training.subtask_step.SubtaskStep"
"""It is not registered, since then every program that discovers plugins would import LeRobot's processors."""

OF_THE_TRAINING: dict[str, Callable[[Any], bool]] = {
    "device": lambda value: isinstance(value, str),
    "features": lambda value: isinstance(value, dict),
    "rename_map": lambda value: (
        isinstance(value, dict) and all(isinstance(new, str) for new in value.values())
    ),
}
"""Options that differ from one training to the next, and what they must be."""


def check_processors(
    folder: Path, allowed: Mapping[str, Sequence[dict[str, Any]]] | None
) -> dict[str, list[str]]:
    """Check both processor files of a folder, and the tensors that they name.

    Args:
        folder: a folder `pretrained_model`.
        allowed: by file, the steps that it must list, in order: their names, and their options by name. None for any
            steps of LeRobot's registry.

    Returns:
        The names of the steps by file.

    Raises:
        CheckpointError: a file is missing or malformed, or lists another step, by class or from outside.
    """
    return {
        name: _check_file(folder / name, None if allowed is None else allowed[name])
        for name in (PREPROCESSOR, POSTPROCESSOR)
    }


def register_steps_of(config: PreTrainedConfig) -> None:
    """Import LeRobot's own steps for one of its policies."""
    importlib.import_module(type(config).__module__.replace("configuration_", "processor_"))


def _check_file(file: Path, allowed: Sequence[dict[str, Any]] | None) -> list[str]:
    steps = read_object(file).get("steps")
    if not isinstance(steps, list) or not all(isinstance(step, dict) for step in steps):
        raise CheckpointError(f"{file} has no list of steps")
    for step in steps:
        _check_step(step, file)
    names = [step.get("registry_name", OWN_CLASS) for step in steps]
    if allowed is not None:
        wanted = [step["registry_name"] for step in allowed]
        if names != wanted:
            raise CheckpointError(f"{file} lists the steps {names}, but must list {wanted}")
        for step, own in zip(steps, allowed, strict=True):
            _check_options(step, own.get("config", {}), file)
    return names


def _check_step(step: dict[str, Any], file: Path) -> None:
    if step == {"class": OWN_CLASS, "config": {}}:
        return
    name = step.get("registry_name")
    if "class" in step or not isinstance(name, str):
        raise CheckpointError(
            f"{file} names a step by class, {step.get('class')!r}, which a loader would call: a step must have a "
            "registered name. Do not load this checkpoint"
        )
    if name not in ProcessorStepRegistry.list() or not _is_lerobots(name):
        raise CheckpointError(f"{file} names the step {name!r}, which LeRobot does not have")
    if unknown := step.keys() - STEP_KEYS:
        raise CheckpointError(f"{file}: the step {name!r} has the unknown key {min(unknown)!r}")
    if not isinstance(step.get("config", {}), dict):
        raise CheckpointError(f"{file}: the options of the step {name!r} are no object")
    if "state_file" in step:
        _check_state_file(step["state_file"], file)


def _check_options(step: dict[str, Any], own: dict[str, Any], file: Path) -> None:
    """Options are those of our own step, but for where it runs and what things are called."""
    for option, value in step.get("config", {}).items():
        if option not in own:
            raise CheckpointError(f"{file}: {step['registry_name']} has no option {option!r}")
        holds = OF_THE_TRAINING[option](value) if option in OF_THE_TRAINING else value == own[option]
        if not holds:
            raise CheckpointError(f"{file}: {step['registry_name']} has the option {option}={value!r}")


def _check_state_file(name: Any, file: Path) -> None:
    if (
        not isinstance(name, str)
        or "\\" in name
        or name in ("", ".", "..")
        or PurePosixPath(name).name != name
    ):
        raise CheckpointError(f"{file} names the state file {name!r}, which is not a file of the same folder")
    check_weights(file.parent / name)


def _is_lerobots(name: str) -> bool:
    return ProcessorStepRegistry.get(name).__module__.partition(".")[0] == "lerobot"
