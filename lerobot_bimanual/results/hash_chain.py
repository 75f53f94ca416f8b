"""A chain over the steps of an episode: a change of one action or state changes every link from there on."""

import base64
import hashlib

import numpy as np
from numpy.typing import NDArray

LINK_BYTES = 4
"""Kept of each link but the last: enough to say where two episodes part, while the last one, whole, proves all."""


class HashChain:
    """Links that each hash the one before, an action, and the state after it.

    Args:
        start: what the first link hangs on: whatever tells the episode apart, and the state at its start.
    """

    def __init__(self, *start: str):
        self._link = hashlib.sha256("\n".join(start).encode()).digest()
        self._links = bytearray()

    def add(self, action: NDArray[np.float32], state_hash: str) -> None:
        """One step: its action and the hash of the state that it led to."""
        self._link = hashlib.sha256(self._link + action.tobytes() + state_hash.encode()).digest()
        self._links += self._link[:LINK_BYTES]

    @property
    def links(self) -> str:
        """The beginning of every link, as text."""
        return base64.b85encode(bytes(self._links)).decode()

    @property
    def end(self) -> str:
        """The last link, 64 hexadecimal digits."""
        return self._link.hex()


def first_difference(links: str, others: str) -> int | None:
    """Index of the first step whose links differ, or that one of the chains lacks; `None` if there is none.

    Raises:
        ValueError: a text is not one of links.
    """
    one, other = _links(links), _links(others)
    pairs = zip(one, other, strict=False)
    differing = next((index for index, (link, another) in enumerate(pairs) if link != another), None)
    if differing is None and len(one) != len(other):
        return min(len(one), len(other))
    return differing


def _links(text: str) -> list[bytes]:
    links = base64.b85decode(text)
    if len(links) % LINK_BYTES:
        raise ValueError(f"links must have {LINK_BYTES} bytes each")
    return [links[start : start + LINK_BYTES] for start in range(0, len(links), LINK_BYTES)]
