"""Weights fit the network, all of them finite."""

from collections.abc import Callable, Collection, Mapping

from torch import Tensor

from lerobot_bimanual.errors import plain
from lerobot_policy_bimanual.errors import CheckpointError


def check_tensors(
    source: str,
    names: Collection[str],
    get: Callable[[str], Tensor],
    expected: Mapping[str, Tensor] | None = None,
) -> int:
    """Check tensors, one at a time.

    Args:
        source: where they come from, for messages.
        names: of the tensors.
        get: gives a tensor by its name.
        expected: tensors on any device, by name, with which they must agree in shape and type; None for any.

    Returns:
        The number of elements of all tensors.

    Raises:
        CheckpointError: they are not those that are expected, or numbers in them are not finite.
    """
    if expected is not None and (differ := set(names) ^ expected.keys()):
        lacking = differ - set(names)
        word, which = ("lacks", lacking) if lacking else ("has unknown", differ)
        raise CheckpointError(
            f"{source} {word} tensors for the network of its config, such as {plain(min(which))}"
        )
    elements = 0
    for name in sorted(names):
        tensor = get(name)
        own = tensor if expected is None else expected[name]
        if (tensor.shape, tensor.dtype) != (own.shape, own.dtype):
            raise CheckpointError(
                f"{plain(name)} in {source} is {tuple(tensor.shape)} {tensor.dtype}, but the network of the config has "
                f"{tuple(own.shape)} {own.dtype}"
            )
        if not (tensor.float() if tensor.itemsize == 1 else tensor).isfinite().all():  # float8 lacks the test
            raise CheckpointError(f"{plain(name)} in {source} holds numbers that are not finite")
        elements += tensor.numel()
    return elements
