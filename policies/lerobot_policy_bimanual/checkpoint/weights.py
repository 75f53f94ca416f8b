"""Files of weights, in the format of safetensors."""

from collections.abc import Mapping
from pathlib import Path

from safetensors import SafetensorError, safe_open
from torch import Tensor

from lerobot_bimanual.errors import plain
from lerobot_policy_bimanual.errors import CheckpointError
from lerobot_policy_bimanual.keypose.weights import check_tensors


def check_weights(file: Path, expected: Mapping[str, Tensor] | None = None) -> int:
    """Check a file of tensors, one tensor at a time.

    Args:
        file: in the format of safetensors, which holds data and no programs.
        expected: tensors with which the file's must agree, if any.

    Returns:
        The number of elements of all tensors.

    Raises:
        CheckpointError: the file is missing, truncated or of another format, or as in `check_tensors`.
    """
    try:
        with safe_open(file, framework="pt") as tensors:
            return check_tensors(str(file), tensors.keys(), tensors.get_tensor, expected)
    except (
        SafetensorError,
        OSError,
        ValueError,
        AttributeError,
        RuntimeError,
    ) as error:  # of types of numbers, too
        raise CheckpointError(
            f"{file} is not a valid safetensors file (missing, truncated or corrupt): {plain(error)}"
        ) from error
