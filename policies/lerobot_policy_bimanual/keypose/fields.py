"""Config fields that know which values they may hold, so that a range is written once, beside the default.

The ranges are wide. They exclude what cannot work, and sizes that would fill the memory of a machine.
"""

from collections.abc import Callable, Sequence
from dataclasses import field, fields
from numbers import Integral, Real
from typing import Any

from lerobot_bimanual.errors import InvalidChoice
from lerobot_policy_bimanual.errors import BadConfig

CHECK = "check"
"""Key of a field's check in its metadata."""


def whole(default: int | None, low: int, high: int) -> Any:
    """Make a field for a whole number, or None if that is the default."""
    unset = " or unset" if default is None else ""
    return _field(default, _within(Integral, low, high), f"a whole number from {low} to {high}{unset}")


def real(default: float, low: float, high: float) -> Any:
    """Make a field for a number."""
    return _field(default, _within(Real, low, high), f"a number from {low} to {high}")


def wholes(default: tuple[int, ...], low: int, high: int, max_length: int) -> Any:
    """Make a field for a list of whole numbers."""
    allowed = f"a list of up to {max_length} whole numbers from {low} to {high}"
    return _field(default, _within(Integral, low, high), allowed, range(max_length + 1))


def reals(default: tuple[float, ...], low: float, high: float) -> Any:
    """Make a field for as many numbers as the default has."""
    count = len(default)
    return _field(
        default, _within(Real, low, high), f"{count} numbers from {low} to {high}", range(count, count + 1)
    )


def texts(max_length: int, max_characters: int) -> Any:
    """Make a field for a list of texts, empty by default."""
    allowed = f"a list of up to {max_length} texts of up to {max_characters} characters"
    return _field(
        (),
        lambda text: isinstance(text, str) and len(text) <= max_characters,
        allowed,
        range(max_length + 1),
    )


def flag(default: bool) -> Any:
    """Make a field for true or false."""
    return _field(default, lambda value: isinstance(value, bool), "true or false")


def choice(default: str, choices: Sequence[str]) -> Any:
    """Make a field for one of a few words."""

    def check(name: str, value: Any) -> None:
        if value not in choices:
            raise InvalidChoice(name, value, choices)

    return field(default=default, metadata={CHECK: check})


def check_fields(config: Any) -> None:
    """Check every field that was made here.

    Raises:
        BadConfig: a value has another type, or is out of its range.
        InvalidChoice: a word is not among the choices.
    """
    for each in fields(config):
        if check := each.metadata.get(CHECK):
            check(each.name, getattr(config, each.name))


def require_multiple(config: Any, name: str, divisor: int, why: str) -> None:
    """Check that a field is a multiple.

    Raises:
        BadConfig: the field is not a multiple of the divisor.
    """
    value = getattr(config, name)
    if value < divisor or value % divisor:
        raise BadConfig(f"{name}={value} must be a multiple of {divisor}: {why}")


def _field(
    default: Any, holds: Callable[[Any], bool], allowed: str, lengths: Sequence[int] | None = None
) -> Any:
    """Make a field for one value, or for a list with one of `lengths`, of which `holds` is true."""

    def check(name: str, value: Any) -> None:
        values = [value] if lengths is None else value
        listed = isinstance(values, tuple | list) and (lengths is None or len(values) in lengths)
        if not (value is default is None or (listed and all(map(holds, values)))):
            raise BadConfig(f"{name} is {value!r}, but must be {allowed}")

    return field(default=default, metadata={CHECK: check})


def _within(kind: type, low: float, high: float) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, kind) and not isinstance(value, bool) and low <= value <= high
