"""Mutations to draw: JSON values of every kind, and files with one thing changed in them."""

import json
from typing import Any

from hypothesis import strategies as st

JSON_VALUES: st.SearchStrategy[Any] = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.sampled_from([10**400, -(10**30), 2**63, 1e308, "9" * 5000])
    | st.floats()
    | st.text(max_size=20)
    | st.sampled_from(["", "any", "test", "../..", "a\nb", "\ud800", "0:1", "0" * 12, "f" * 64]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
"""What JSON can say, and a little that it cannot: NaN, infinities, half characters."""


@st.composite
def mutated_json(draw: st.DrawFn, content: Any) -> bytes:
    """The text of a JSON value in which one place holds something else, lies twice, or is gone; or a mangled text."""
    content = json.loads(json.dumps(content))
    for _ in range(draw(st.integers(0, 2))):
        _mutate_a_value(draw, content)
    text = json.dumps(content).encode()
    return draw(st.just(text) | mangled(text))


@st.composite
def mangled(draw: st.DrawFn, text: bytes) -> bytes:
    """A text that was cut, or holds other bytes in one place."""
    at = draw(st.integers(0, len(text)))
    put = draw(
        st.sampled_from([b"", b"\x00", b"\xff", b"\xef\xbb\xbf", b"NaN", b"1e999", b"[" * 5000, b"\n", b'"'])
    )
    rest = draw(st.sampled_from([0, 1, 50, len(text)]))  # bytes that are lost
    return text[:at] + put + text[at + rest :]


def _mutate_a_value(draw: st.DrawFn, content: Any) -> None:
    container = content
    while True:
        keys = list(container) if isinstance(container, dict) else range(len(container))
        if not keys:
            return
        key = draw(st.sampled_from(keys))
        inner = container[key]
        if not isinstance(inner, dict | list) or not inner or draw(st.integers(0, 3)) == 0:
            break
        container = inner
    kind = draw(st.sampled_from(["replace", "remove", "repeat", "add"]))
    if kind == "remove":
        del container[key]
    elif kind == "repeat" and isinstance(container, list):
        container.append(container[key])
    elif kind == "add" and isinstance(container, dict):
        container[draw(st.text(max_size=8))] = draw(JSON_VALUES)
    else:
        container[key] = draw(JSON_VALUES)


def check_clear(error: Exception, *words: str) -> None:
    """An error message is one line that any terminal can print, with these words in it."""
    message = str(error)
    message.encode()
    assert "\n" not in message
    for word in words:
        assert word in message
