"""The proof of an episode, as text: its actions, and a chain of hashes over its steps.

Actions are stored without loss in a few bytes each. Consecutive actions are similar: the bits in which they differ are sorted
by the significance of their bytes, so that the many zero bytes are adjacent, and compressed. In the chain, a change of one
action or state changes every link from there on.
"""

import base64
import binascii
import hashlib
import re
import zlib
from itertools import zip_longest

import numpy as np
from numpy.typing import ArrayLike, NDArray

LITTLE_ENDIAN = "<u4"
HEAD = re.compile(r"([0-9]{1,6})x([0-9]{1,4}):")
MAX_ACTIONS, MAX_NUMBERS = 100_000, 10_000_000
"""Of one episode; an hour of joint actions has 72,000 with 1.3 million numbers."""


def actions_to_text(actions: ArrayLike) -> str:
    """Actions (n, numbers) float32 as a text such as "7x18:...", NaNs and all."""
    array = np.asarray(actions, dtype=np.float32)
    bits = array.view(np.uint32)
    changes = bits.copy()
    changes[1:] ^= bits[:-1]
    planes = np.frombuffer(changes.astype(LITTLE_ENDIAN).tobytes(), np.uint8).reshape(array.size, 4).T
    packed = zlib.compress(planes.tobytes(), level=9)
    return f"{array.shape[0]}x{array.shape[1]}:{base64.b85encode(packed).decode()}"


def actions_from_text(text: str) -> NDArray[np.float32]:
    """The actions (n, numbers) float32 of a text by `actions_to_text`.

    Raises:
        ValueError: the text is malformed.
    """
    head = HEAD.match(text)
    if head is None:
        raise ValueError("actions must begin with their number and length, such as '7x18:'")
    count, length = map(int, head.groups())
    size = count * length
    if count > MAX_ACTIONS or size > MAX_NUMBERS:
        raise ValueError(f"{count} actions of {size} numbers are more than any episode has")
    try:
        inflate = zlib.decompressobj()
        planes = inflate.decompress(base64.b85decode(text[head.end() :]), size * 4 + 1)
    except (ValueError, binascii.Error, zlib.error) as error:
        raise ValueError(f"actions cannot be unpacked: {error}") from error
    if len(planes) != size * 4 or not inflate.eof:
        raise ValueError(f"actions are not the {count} x {length} numbers that they begin with")
    changes = np.frombuffer(planes, np.uint8).reshape(4, size).T.copy().view(LITTLE_ENDIAN)
    bits = np.bitwise_xor.accumulate(changes.reshape(count, length).astype(np.uint32), axis=0)
    return bits.view(np.float32)


LINK_BYTES = 4
"""Bytes kept of each link: enough to find where two episodes diverge. The last link is kept whole, as the proof of all."""


class HashChain:
    """Links that each hash the one before, an action, and the state after it.

    The first link follows a hash of `start`: what identifies the episode, and its initial state.
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
    pairs = enumerate(zip_longest(_links(links), _links(others)))
    return next((index for index, (link, another) in pairs if link != another), None)


def _links(text: str) -> list[bytes]:
    links = base64.b85decode(text)
    if len(links) % LINK_BYTES:
        raise ValueError(f"links must have {LINK_BYTES} bytes each")
    return [links[start : start + LINK_BYTES] for start in range(0, len(links), LINK_BYTES)]
