"""Findings of checks: what is wrong, and where."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from lerobot_bimanual.errors import BimanualError

READABLE = "readable"
"""Name of the check that a view or an episode can be read at all; if it fails, nothing else of it is checked."""


@dataclass(frozen=True)
class Fault:
    """A fault: what was found and what was expected; `row` is given if it concerns a single row of the episode."""

    text: str
    row: int | None = None


class Findings(dict[str, list[Fault]]):
    """Check -> its faults; an empty list for a check that passed."""

    @contextmanager
    def of(self, check: str) -> Iterator[list[Fault]]:
        """The list of faults of a check, while it runs; an exception of the check becomes a fault, too.

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
