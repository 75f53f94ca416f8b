"""Actions as text, in a few bytes each and without losing a bit.

Consecutive actions resemble each other: what differs between their bit patterns is sorted by significance, so that the
many zero bytes stand together, and compressed.
"""

import base64
import binascii
import re
import zlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

LITTLE_ENDIAN = "<u4"
HEAD = re.compile(r"([0-9]{1,6})x([0-9]{1,4}):")
MAX_NUMBERS = 10_000_000
"""Of one text; an hour of joint actions has a tenth of it."""


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
    """The actions (n, numbers) float32 of such a text.

    Raises:
        ValueError: it is none.
    """
    head = HEAD.match(text)
    if head is None:
        raise ValueError("actions must begin with their number and length, such as '7x18:'")
    count, length = map(int, head.groups())
    size = count * length
    if size > MAX_NUMBERS:
        raise ValueError(f"actions of {size} numbers are more than any episode has")
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
