"""Weights of a checkpoint: safetensors that fit the network, all of them finite."""

from collections.abc import Mapping
from pathlib import Path

from safetensors import SafetensorError, safe_open
from torch import Tensor

from lerobot_policy_bimanual.errors import CheckpointError


def check_weights(file: Path, expected: Mapping[str, Tensor] | None = None) -> int:
    """Check a file of tensors, one tensor at a time.

    Args:
        file: in the format of safetensors, which holds data and no programs.
        expected: tensors on any device, by name, with which the file's must agree in shape and type; None for any.

    Returns:
        The number of elements of all tensors.

    Raises:
        CheckpointError: the file is missing, truncated or of another format, its tensors are not those that are
            expected, or numbers in it are not finite.
    """
    elements = 0
    try:
        with safe_open(file, framework="pt") as tensors:
            names = set(tensors.keys())
            if expected is not None and (differ := names ^ expected.keys()):
                missing = expected.keys() - names
                raise CheckpointError(
                    f"{file} {'lacks' if missing else 'has unknown'} tensors for the network of its config, such as "
                    f"{min(missing or differ)}"
                )
            for name in sorted(names):
                tensor = tensors.get_tensor(name)
                own = tensor if expected is None else expected[name]
                if (tensor.shape, tensor.dtype) != (own.shape, own.dtype):
                    raise CheckpointError(
                        f"{name} in {file} is {tuple(tensor.shape)} {tensor.dtype}, but the network of the config has "
                        f"{tuple(own.shape)} {own.dtype}"
                    )
                if not tensor.isfinite().all():
                    raise CheckpointError(f"{name} in {file} holds numbers that are not finite")
                elements += tensor.numel()
    except (SafetensorError, OSError, UnicodeDecodeError) as error:
        raise CheckpointError(
            f"{file} is not a valid safetensors file (missing, truncated or corrupt): {error}"
        ) from error
    return elements
