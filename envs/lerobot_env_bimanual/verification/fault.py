"""What a check says when something is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lerobot_bimanual.errors import BimanualError


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


def faults_of[**Arguments](
    check: Callable[Arguments, Iterator[Fault]], *args: Arguments.args, **kwargs: Arguments.kwargs
) -> tuple[Fault, ...]:
    """All that a check finds; a check that breaks is a finding, too.

    Damaged files make libraries raise nearly anything. What a check cannot read has not passed, and all other checks
    and episodes are still reported.
    """
    found: list[Fault] = []
    try:
        found.extend(check(*args, **kwargs))
    except BimanualError as error:
        found.append(Fault(str(error)))
    except Exception as error:
        found.append(Fault(f"cannot be checked: {type(error).__name__}: {error}"))
    return tuple(found)
