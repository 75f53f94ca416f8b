"""Reading JSON that others have written, or damaged."""

import json
from pathlib import Path
from typing import Any, NoReturn

from lerobot_bimanual.errors import BimanualError

MOST_BYTES = 2**26
"""Larger than any config, certificate or result."""


def parse_json(text: str | bytes) -> Any:
    """The value of a JSON text.

    Raises:
        BimanualError: it is none, not even as UTF-8, is nested deeper than anything of ours, or holds a key twice or a
            number that is not finite.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_object)
    except (ValueError, RecursionError) as error:
        raise BimanualError(f"must be JSON: {error}") from error


def read_json(path: Path, most_bytes: int = MOST_BYTES) -> Any:
    """The value in a JSON file.

    Args:
        path: the file.
        most_bytes: what is larger is not read.

    Raises:
        BimanualError: the file cannot be read, is too large, or is no JSON; the message names it.
    """
    try:
        if path.stat().st_size > most_bytes:
            raise BimanualError(f"larger than {most_bytes // 2**20} MB, which no such file is")
        return parse_json(path.read_bytes())
    except (OSError, BimanualError) as error:
        raise BimanualError(f"{path}: {error}") from error


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"the key {next(key for key in keys if keys.count(key) > 1)!r} stands there twice")
    return values
