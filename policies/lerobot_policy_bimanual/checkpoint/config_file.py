"""The config of a checkpoint, read without LeRobot's loader, and checked to mean what it says."""

from pathlib import Path
from typing import Any

import draccus
from draccus.utils import DecodingError, DraccusException
from lerobot.configs import PreTrainedConfig

import lerobot_policy_bimanual.configurations  # noqa: F401  registers our policies
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import read_json
from lerobot_policy_bimanual.checkpoint.folder import CONFIG_FILE, require_checkpoint
from lerobot_policy_bimanual.errors import CheckpointError

MOST_BYTES = 2**24
"""Larger than any config."""
KNOWN_PACKAGES = ("lerobot", "lerobot_policy_bimanual")

OF_THE_MACHINE = ("device", "use_amp")
"""Fields that LeRobot changes when it reads them on a machine without that device."""


def read_config(folder: Path) -> PreTrainedConfig:
    """The config in a folder `pretrained_model`; nothing is built from it.

    Raises:
        CheckpointError: there is none, its policy is not known, or a field is unknown, of another type or out of
            its range.
    """
    require_checkpoint(folder)
    file = folder / CONFIG_FILE
    values = read_object(file)
    config_class = _class_of(values.pop("type", None), file)
    try:
        config = draccus.decode(config_class, values)
    except BimanualError as error:
        raise CheckpointError(f"{file}: {error}") from error
    except (
        DraccusException,
        ValueError,
        TypeError,
        AttributeError,
        KeyError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise CheckpointError(f"{file}: {_in_one_line(error)}") from error
    understood = draccus.encode(config, PreTrainedConfig)
    lerobots = _package(config_class) == "lerobot"
    for name, value in values.items():
        if lerobots and isinstance(value, bool):
            continue  # ACT writes false for a whole number by default
        if name not in OF_THE_MACHINE and not _same(value, understood[name]):
            raise CheckpointError(f"{file}: {name} is {value!r}, which would be read as {understood[name]!r}")
    if config.use_peft:
        raise CheckpointError(f"{file}: use_peft is true, but adapters cannot be checked")
    return config


def read_object(file: Path) -> dict[str, Any]:
    """The object in a JSON file of a checkpoint.

    Raises:
        CheckpointError: it is missing, no JSON, or holds something else.
    """
    if not file.is_file():
        raise CheckpointError(f"{file} does not exist: the checkpoint is incomplete")
    try:
        value = read_json(file, MOST_BYTES)
    except BimanualError as error:
        raise CheckpointError(str(error)) from error
    if not isinstance(value, dict):
        raise CheckpointError(f"{file} holds a {type(value).__name__}, but must hold an object")
    return value


def _class_of(name: Any, file: Path) -> type[PreTrainedConfig]:
    known = {
        known: config_class
        for known, config_class in PreTrainedConfig.get_known_choices().items()
        if _package(config_class) in KNOWN_PACKAGES
    }
    if not isinstance(name, str) or name not in known:
        raise CheckpointError(f"{file}: type is {name!r}, but must be one of: {', '.join(sorted(known))}")
    return known[name]


def _package(config_class: type) -> str:
    return config_class.__module__.partition(".")[0]


def _same(written: Any, understood: Any) -> bool:
    """Whether a value was read as it stands there, and not turned into something else."""
    if isinstance(written, dict) and isinstance(understood, dict):
        return written.keys() == understood.keys() and all(
            _same(written[key], understood[key]) for key in written
        )
    if isinstance(written, list) and isinstance(understood, list | tuple):
        return len(written) == len(understood) and all(map(_same, written, understood))
    return isinstance(written, bool) == isinstance(understood, bool) and written == understood


def _in_one_line(error: BaseException) -> str:
    """What went wrong: a field that could not be read, or what lies below the layers of the parser."""
    while error.__cause__ is not None and not isinstance(error, DecodingError):
        error = error.__cause__
    return " ".join(str(error).split())
