"""Reading JSON that others may have damaged."""

import json
from pathlib import Path
from typing import Any

from lerobot_bimanual.errors import BimanualError


def parse_json(text: str | bytes) -> Any:
    """The value of a JSON text.

    Raises:
        BimanualError: it is none, not even as UTF-8, or is nested deeper than anything that was measured.
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BimanualError(f"must be JSON: {error}") from error


def read_json(path: Path) -> Any:
    """The value in a JSON file.

    Raises:
        BimanualError: the file cannot be read, or is no JSON; the message names it.
    """
    try:
        return parse_json(path.read_bytes())
    except (OSError, BimanualError) as error:
        raise BimanualError(f"{path}: {error}") from error
