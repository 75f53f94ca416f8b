"""JSON files of unknown origin."""

import json
from pathlib import Path
from typing import Any, NoReturn

from lerobot_policy_bimanual.errors import CheckpointError

MOST_BYTES = 2**24
"""Larger than the config of any policy."""


def read_object(file: Path) -> dict[str, Any]:
    """The object that a file holds.

    Raises:
        CheckpointError: The file is missing, too large, not UTF-8, no JSON, too deeply nested, holds a number that is
            not finite or a key twice, or is something else than an object.
    """
    if not file.is_file():
        raise CheckpointError(f"{file} does not exist: the checkpoint is incomplete")
    if file.stat().st_size > MOST_BYTES:
        raise CheckpointError(f"{file} is larger than {MOST_BYTES // 2**20} MB, which no config is")
    try:
        value = json.loads(
            file.read_text(encoding="utf-8"), parse_constant=_refuse_constant, object_pairs_hook=_object
        )
    except (ValueError, RecursionError, OSError) as error:
        raise CheckpointError(f"{file} is no valid JSON: {error}") from error
    if not isinstance(value, dict):
        raise CheckpointError(f"{file} holds a {type(value).__name__}, but must hold an object")
    return value


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    if twice := {key for key in keys if keys.count(key) > 1}:
        raise ValueError(f"the key {min(twice)!r} stands there twice")
    return dict(pairs)
