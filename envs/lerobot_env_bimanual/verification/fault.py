"""What a check says when something is wrong."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lerobot_bimanual.errors import BimanualError

READABLE = "readable"
"""Check whether something can be read at all; nothing else is checked of what cannot."""


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


class Findings(dict[str, list[Fault]]):
    """Check -> what is wrong, an empty list for a check that passed."""

    @contextmanager
    def of(self, check: str) -> Iterator[list[Fault]]:
        """The list of a check, for as long as it runs; a check that breaks is a finding, too.

        Damaged files make libraries raise nearly anything. What a check cannot read has not passed, and all other checks
        and episodes are still reported.
        """
        found = self.setdefault(check, [])
        try:
            yield found
        except BimanualError as error:
            found.append(Fault(str(error)))
        except Exception as error:
            found.append(Fault(f"cannot be checked: {type(error).__name__}: {error}"))
