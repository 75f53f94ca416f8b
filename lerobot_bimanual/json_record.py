"""Dataclasses from JSON: every field there, none beyond, each of its kind, and what is not is named."""

import functools
import types
import typing
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import read_json, shown

MAX_NAMED = 10
"""Of unknown fields, in one message."""


class BadRecord(BimanualError):
    """A JSON value of another form than was asked for; the message names its place."""


def decode[Kind](kind: type[Kind], value: Any, place: str, partly: bool = False) -> Kind:
    """A dataclass from the JSON value that `dataclasses.asdict` would have given.

    Nothing is converted but lists to tuples and integers to floats.

    Args:
        kind: the dataclass; its fields may be numbers, texts, choices, `Any`, optional, tuples and dictionaries, and
            dataclasses of such.
        value: what `json_file.parse_json` has read.
        place: what the value is called in messages.
        partly: whether the value may hold unknown fields.

    Raises:
        BadRecord: a field is missing, unknown or of another kind, or the dataclass refuses its values with a
            `ValueError`.
    """
    return _decode(kind, value, place, partly)


def read[Kind](kind: type[Kind], path: Path, place: str) -> Kind:
    """A dataclass from a JSON file, as `decode` has it.

    Args:
        kind: the dataclass.
        path: the file.
        place: what its content is called in messages.

    Raises:
        BimanualError: the file cannot be read, or holds something else; the message names it.
    """
    content = read_json(path)
    try:
        return decode(kind, content, place)
    except BadRecord as error:
        raise BadRecord(f"{path}: {error}") from error


def _decode(kind: Any, value: Any, place: str, partly: bool) -> Any:
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return value
    if origin is Literal:
        if value not in inner:
            raise BadRecord(f"{place} is {shown(value)}, but must be one of: {', '.join(map(str, inner))}")
        return value
    if origin is types.UnionType:
        return None if value is None else _decode(inner[0], value, place, partly)
    if origin is tuple:
        return _decode_tuple(inner, _expect(list, value, place), place, partly)
    if origin is dict:
        items = _expect(dict, value, place)
        return {key: _decode(inner[1], item, f"{place}.{_name(key)}", partly) for key, item in items.items()}
    if is_dataclass(kind):
        return _decode_fields(kind, _expect(dict, value, place), place, partly)
    if kind is float and type(value) is int and abs(value) < 2**53:
        return float(value)
    return _expect(kind, value, place)


def _decode_tuple(kinds: tuple[Any, ...], items: list[Any], place: str, partly: bool) -> tuple[Any, ...]:
    if kinds[-1] is Ellipsis:
        kinds = kinds[:1] * len(items)
    if len(kinds) != len(items):
        raise BadRecord(f"{place} is {shown(items)}, but must hold {len(kinds)} values")
    return tuple(
        _decode(kind, item, f"{place}[{index}]", partly)
        for index, (kind, item) in enumerate(zip(kinds, items, strict=True))
    )


def _decode_fields(kind: Any, content: Mapping[str, Any], place: str, partly: bool) -> Any:
    hints = _hints(kind)
    names = [*hints]
    unknown = set() if partly else set(content) - set(names)
    for wrong, problem in ((set(names) - set(content), "lacks"), (unknown, "has unknown")):
        if wrong:
            listed = ", ".join(sorted(map(_name, wrong))[:MAX_NAMED])
            raise BadRecord(f"{place} {problem} {listed}; its fields are {', '.join(names)}")
    values = {name: _decode(hints[name], content[name], f"{place}.{name}", partly) for name in names}
    try:
        return kind(**values)
    except ValueError as error:
        raise BadRecord(f"{place}: {error}") from error


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    """Each field's annotation, in the order of the fields."""
    hints = typing.get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind)}


def _name(key: str) -> str:
    """A key for a message, on one line."""
    return key if key.isprintable() and len(key) < 60 else shown(key)


def _expect(kind: type, value: Any, place: str) -> Any:
    if type(value) is not kind:
        raise BadRecord(f"{place} is {shown(value)}, but must be a {kind.__name__}")
    return value
