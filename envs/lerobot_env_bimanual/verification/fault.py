"""What a check says when something is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Fault:
    """Something wrong.

    Attributes:
        text: what was found, and what was expected.
        row: row of the episode, `None` if it concerns all of it.
    """

    text: str
    row: int | None = None


def first_of(wrong_rows: ArrayLike, text: str) -> Iterator[Fault]:
    """One fault for the first of the rows that are wrong, none if none is.

    Args:
        wrong_rows: (rows,) bool.
        text: what is wrong with them.
    """
    rows = np.flatnonzero(wrong_rows)
    if len(rows):
        more = f" (and {len(rows) - 1} more rows)" if len(rows) > 1 else ""
        yield Fault(text + more, int(rows[0]))
