"""Being on lists for a while, such as those of an episode's observers."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def joined(*places: tuple[list[Any], Any]) -> Iterator[None]:
    """Append each member to its list while the `with` block runs; None is nobody."""
    taken = [(members, member) for members, member in places if member is not None]
    for members, member in taken:
        members.append(member)
    try:
        yield
    finally:
        for members, member in taken:
            members.remove(member)
