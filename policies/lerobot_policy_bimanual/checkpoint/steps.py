"""Processor steps that load nothing by name, with their options and tensors: a safe checkpoint names no others."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import torch
from pydantic import Field, PositiveFloat, model_validator
from safetensors import SafetensorError, safe_open
from torch import Tensor

from lerobot_bimanual.errors import plain, shown
from lerobot_bimanual.results.record import BadRecord, Record, require
from lerobot_policy_bimanual.errors import CheckpointError

type Kind = Literal["STATE", "VISUAL", "ENV", "ACTION", "REWARD", "LANGUAGE"]
type Mode = Literal["MIN_MAX", "MEAN_STD", "IDENTITY", "QUANTILES", "QUANTILE10"]
type Float = Literal["float16", "float32", "float64", "bfloat16", "half", "float", "double"]

HALF_PRECISION = (torch.float16, torch.bfloat16)
MAX_NUMBERS = 2**24
"""Of an input or output; an RGB image of 2365 x 2365 pixels has as many."""


class UnverifiableCheckpoint(CheckpointError):
    """A checkpoint of which a part may load something by name.

    Args:
        what: the part of the checkpoint.
        named: options of that part that may load something, as text.
    """

    exit_code = 3

    def __init__(self, what: str, named: str):
        super().__init__(
            f"cannot tell whether loading is safe: {what} {f'loads {named}' if named else 'may load something'} by name, whose "
            "code then runs; if you trust its source, or it is your own, give --trust_checkpoint=true to programs that load it"
        )


class Feature(Record):
    """An input or output of a policy, of a size that memory can hold."""

    type: Kind
    shape: Annotated[tuple[Annotated[int, Field(ge=1, le=2**14)], ...], Field(max_length=4)]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        require(math.prod(self.shape) <= MAX_NUMBERS, f"shape: must have at most {MAX_NUMBERS} numbers")
        return self


class _Step(Record):
    registry_name: str
    config: Annotated[dict[str, Any], Field(default={})]
    state_file: Annotated[str, Field(pattern=r"^\w[\w.-]{0,200}$")] | None = None


class _Processor(Record):
    name: str
    steps: tuple[_Step, ...]


class _Rename(Record):
    rename_map: Annotated[dict[str, str], Field(default={})]


class _Device(Record):
    device: Annotated[str, Field(pattern=r"^(cpu|cuda|mps|xpu)(:\d{1,3})?$")]
    float_dtype: Float | None = None


class _Normalizer(Record):
    eps: PositiveFloat
    features: dict[str, Feature]
    norm_map: dict[Kind, Mode]
    normalize_observation_keys: tuple[str, ...] | None = None


SAFE_STEPS: dict[str, type[Record]] = {
    "rename_observations_processor": _Rename,
    "to_batch_processor": Record,
    "device_processor": _Device,
    "normalizer_processor": _Normalizer,
    "unnormalizer_processor": _Normalizer,
}
"""By name in LeRobot's registry."""


def check_classes(file: Path, processor: object) -> None:
    """Refuse a processor with a step that is named by a class, as `CheckpointError`, whatever else is wrong."""
    steps = processor.get("steps") if isinstance(processor, dict) else None
    for step in steps if isinstance(steps, list) else ():
        if isinstance(step, dict) and "class" in step:
            raise CheckpointError(
                f"{file} names the class {shown(step['class'])}, which LeRobot's loader would call. Do not load this checkpoint"
            )


def step_names(file: Path, processor: object) -> list[str]:
    """Check the options and tensors of the steps of a processor, the JSON value in a file, and return the names of the steps.

    Raises:
        CheckpointError: the file is malformed, or an option or a tensor is.
        UnverifiableCheckpoint: a step or an option may load something by name.
    """
    try:
        steps = _Processor.from_json(json.dumps(processor)).steps
        for step in steps:
            _check_options(file, step)
            if step.state_file is not None:
                check_weights(file.parent / step.state_file)
    except BadRecord as error:
        raise CheckpointError(f"{file}: {error}") from error
    return [step.registry_name for step in steps]


def options_text(options: Mapping[str, object]) -> str:
    """The first few options with their values, for a message."""
    return ", ".join(f"{plain(key)}={shown(value)}" for key, value in [*options.items()][:5])


def _check_options(file: Path, step: _Step) -> None:
    """Refuse options that a step does not have, or whose values may load something."""
    kind = SAFE_STEPS.get(step.registry_name)
    not_texts = [key for key, option in step.config.items() if not isinstance(option, str)]
    known = kind.model_fields if kind else not_texts
    unknown = {key: value for key, value in step.config.items() if key not in known}
    if kind is None or unknown:
        raise UnverifiableCheckpoint(f"{file}: the step {shown(step.registry_name)}", options_text(unknown))
    kind.from_json(json.dumps(step.config))


def check_weights(file: Path, expected: Mapping[str, Tensor] | None = None) -> int:
    """Check a file of tensors, one tensor at a time.

    Args:
        file: in the format of safetensors, which holds data and no programs.
        expected: tensors on any device, by name, with which the file's must agree in shape and type; None for any.

    Returns:
        The number of elements of all tensors.

    Raises:
        CheckpointError: the file is missing, truncated or of another format, its tensors are not those that are expected,
            or numbers in them are not finite.
    """
    try:
        if not file.is_file():  # a pipe never ends
            raise OSError("not a file")
        with safe_open(file, framework="pt") as tensors:
            names, own = sorted(tensors.keys()), expected or {}
            if expected is not None and (differ := set(names) ^ expected.keys()):
                lacking = differ - set(names)
                word, which = ("lacks", lacking) if lacking else ("has unknown", differ)
                raise CheckpointError(
                    f"{file} {word} tensors for the network of its config, such as {plain(min(which))}"
                )
            return sum(
                _checked_size(f"{plain(name)} in {file}", tensors.get_tensor(name), own.get(name))
                for name in names
            )
    except (SafetensorError, OSError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        raise CheckpointError(
            f"{file} is not a valid safetensors file (missing, truncated or corrupt): {plain(error)}"
        ) from error


def _checked_size(source: str, tensor: Tensor, expected: Tensor | None) -> int:
    """The number of elements of a tensor that is finite and as expected; weights may be of half precision."""
    if expected is not None and _kind(tensor) != _kind(expected):
        raise CheckpointError(
            f"{source} is {tuple(tensor.shape)} {tensor.dtype}, but the network of the config has "
            f"{tuple(expected.shape)} {expected.dtype}"
        )
    if not (tensor.float() if tensor.itemsize == 1 else tensor).isfinite().all():  # float8 lacks the test
        raise CheckpointError(f"{source} holds numbers that are not finite")
    return tensor.numel()


def _kind(tensor: Tensor) -> tuple[torch.Size, torch.dtype]:
    """Shape and type, of which loading makes float32 if it is of half precision."""
    return tensor.shape, torch.float32 if tensor.dtype in HALF_PRECISION else tensor.dtype
