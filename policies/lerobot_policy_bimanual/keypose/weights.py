"""Weights of a checkpoint: none missing, none too many, of the right shape and type, all finite."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file
from torch import Tensor, nn

from lerobot_policy_bimanual.errors import CheckpointError

SHOWN_NAMES = 3
"""Names of tensors in a message."""


@dataclass(frozen=True)
class WeightCount:
    """What a file of tensors holds.

    Attributes:
        tensors: their number.
        parameters: the number of their elements.
        dtypes: the types of their elements, sorted.
    """

    tensors: int
    parameters: int
    dtypes: tuple[str, ...]


def load_weights(model: nn.Module, file: Path) -> None:
    """Give a model the weights of a file.

    Raises:
        CheckpointError: as in `check_weights`; the model is unchanged then.
    """
    check_weights(file, model.state_dict())
    model.load_state_dict(load_file(file))


def check_weights(file: Path, expected: Mapping[str, Tensor] | None = None) -> WeightCount:
    """Check a file of tensors, one tensor at a time.

    Args:
        file: in the format of safetensors, which holds data and no programs.
        expected: tensors by name whose shape and type the file's must have, of any device; None where only the
            file tells which there are.

    Raises:
        CheckpointError: the file is missing, truncated or of another format, its tensors are not those that are
            expected, or numbers in it are not finite.
    """
    if not file.is_file():
        raise CheckpointError(f"{file} does not exist: the checkpoint is incomplete")
    elements, dtypes = 0, set()
    try:
        with safe_open(file, framework="pt") as tensors:
            names = tensors.keys()
            if expected is not None:
                _check_names(file, set(names), set(expected))
            for name in names:
                tensor = tensors.get_tensor(name)
                if expected is not None:
                    _check_kind(f"{name} in {file}", tensor, expected[name])
                if not torch.isfinite(tensor).all():
                    raise CheckpointError(f"{name} in {file} holds numbers that are not finite")
                elements += tensor.numel()
                dtypes.add(str(tensor.dtype).removeprefix("torch."))
    except (SafetensorError, OSError, UnicodeDecodeError) as error:
        raise CheckpointError(f"{file} is no whole file of tensors (safetensors): {error}") from error
    return WeightCount(len(names), elements, tuple(sorted(dtypes)))


def _check_names(file: Path, names: set[str], expected: set[str]) -> None:
    for others, what in ((expected - names, "lacks"), (names - expected, "has too many")):
        if others:
            shown = ", ".join(sorted(others)[:SHOWN_NAMES]) + (", ..." if len(others) > SHOWN_NAMES else "")
            raise CheckpointError(
                f"{file} {what} tensors for the network of its config: {len(others)}, {shown}"
            )


def _check_kind(what: str, tensor: Tensor, expected: Tensor) -> None:
    if tensor.shape != expected.shape or tensor.dtype != expected.dtype:
        raise CheckpointError(
            f"{what} is {tuple(tensor.shape)} {tensor.dtype}, but the network of the config has "
            f"{tuple(expected.shape)} {expected.dtype} there"
        )
