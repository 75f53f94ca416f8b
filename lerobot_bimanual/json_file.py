"""Reading JSON that others have written, or damaged."""

import json
import math
from pathlib import Path
from typing import Any, NoReturn

from lerobot_bimanual.errors import BimanualError

MAX_BYTES = 2**26
"""Larger than any config, certificate or result."""
MAX_DEPTH = 64
"""Lists and objects within each other; none of ours has ten."""


def parse_json(text: str | bytes) -> Any:
    """The value of a JSON text.

    Raises:
        BimanualError: it is none, not even as UTF-8, is nested deeper than anything of ours, or holds a key twice, a
            number that is not finite, or text that no file can hold.
    """
    try:
        text = text if isinstance(text, str) else text.decode("utf-8")
        value = json.loads(
            text, parse_constant=_refuse_constant, parse_float=_finite, object_pairs_hook=_object
        )
        _refuse_depth_and_surrogates(value)
        return value
    except (ValueError, RecursionError) as error:
        raise BimanualError(f"must be JSON: {error}") from error


def read_json(path: Path, max_bytes: int = MAX_BYTES) -> Any:
    """The value in a JSON file.

    Args:
        path: the file.
        max_bytes: what is larger is not read.

    Raises:
        BimanualError: the file cannot be read, is too large, or is no JSON; the message names it.
    """
    try:
        return parse_json(read_bytes(path, max_bytes))
    except (OSError, BimanualError) as error:
        raise BimanualError(f"{path}: {error}") from error


def shown(value: object, most: int = 120) -> str:
    """A value for a message: on one line, and not all of it where it is long."""
    try:
        text = repr(value)
    except ValueError:  # an integer of thousands of digits
        text = f"a number of {type(value).__name__} that is too long to print"
    return text if len(text) <= most else f"{text[:most]}..."


def read_bytes(path: Path, max_bytes: int = MAX_BYTES) -> bytes:
    """The content of a file that is no larger than ours are.

    Raises:
        OSError: it cannot be read.
        BimanualError: it is no file, or too large.
    """
    path.stat()  # says best why there is nothing to open
    if not path.is_file():  # a pipe or a device may never end
        raise BimanualError("not a file")
    with path.open("rb") as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise BimanualError(f"larger than {max_bytes // 2**20} MB, which no such file is")
    return content


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is larger than any number")
    return number


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, value in pairs:
        if key in values:
            raise ValueError(f"duplicate key {shown(key)}")
        values[key] = value
    return values


def _refuse_depth_and_surrogates(value: Any) -> None:
    """Reject lone surrogates, which cannot be printed, and excessive nesting."""
    level = [value]
    for _ in range(MAX_DEPTH):
        for item in level:
            if isinstance(item, str):
                item.encode()
        containers = [item for item in level if isinstance(item, dict | list)]
        if not containers:
            return
        level = [inner for item in containers for inner in _parts(item)]
    raise ValueError(f"nested deeper than {MAX_DEPTH} levels")


def _parts(container: dict[str, Any] | list[Any]) -> list[Any]:
    return [*container.keys(), *container.values()] if isinstance(container, dict) else container
