"""Checks of the arguments of `reset`."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

import numpy as np

from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.options import check_variation

MAX_SEED = 2**63 - 1
"""The largest that a dataset's column can hold."""

VARIATION = "variation"


def checked_seed(seed: Any) -> int | None:
    """A seed as a plain integer, or `None`.

    Raises:
        InvalidChoice: it is neither an integer from 0 to `MAX_SEED` nor `None`.
    """
    if seed is None:
        return None
    is_integer = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
    if not is_integer or not 0 <= int(seed) <= MAX_SEED:
        raise InvalidChoice("seed", seed, ["an integer from 0 to 2**63 - 1", "None"])
    return int(seed)


def checked_seeds(seed: Any, count: int) -> list[int | None]:
    """The seeds of several environments: those of a list, or a single one counted up.

    Raises:
        InvalidChoice: a seed is none, or there are not as many as environments.
    """
    if isinstance(seed, np.ndarray) and not seed.ndim:
        seed = seed[()]
    if isinstance(seed, list | tuple | np.ndarray):
        if len(seed) != count:
            raise InvalidChoice("seed", seed, [f"a list of {count}, one per environment", "a single seed"])
        return [checked_seed(single) for single in seed]
    first = checked_seed(seed)
    return [None if first is None else checked_seed(first + index) for index in range(count)]


def checked_reset_options(options: Any) -> Mapping[str, Any]:
    """The options of a reset; those of other callers, such as LeRobot's, are let through.

    Raises:
        InvalidChoice: they are no mapping, or one of them looks like `variation` misspelt.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise InvalidChoice("options", options, ["None", "a mapping such as {'variation': 0}"])
    for name in options:
        if name != VARIATION and difflib.get_close_matches(str(name).lower(), [VARIATION], cutoff=0.8):
            raise InvalidChoice("an option of reset", name, [VARIATION])
    check_variation(options.get(VARIATION))
    return options
