"""What a check says when something is wrong."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from lerobot_bimanual.errors import BimanualError

READABLE = "readable"
"""Check whether something can be read at all; nothing else is checked of what cannot."""


@dataclass(frozen=True)
class Fault:
    """Something wrong: what was found and what was expected; with the row of the episode unless it concerns all of it."""

    text: str
    row: int | None = None


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
