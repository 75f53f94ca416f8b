"""Config fields that know which values they may hold, so that a range stands once, beside its number.

The ranges are wide. They keep out what cannot work, and what would fill a machine before anyone sees why.
"""

from collections.abc import Callable, Sequence
from dataclasses import field, fields
from numbers import Integral, Real
from typing import Any

from lerobot_bimanual.errors import InvalidChoice
from lerobot_policy_bimanual.errors import BadConfig

CHECK = "check"
"""Under which a field's metadata hold its check, which raises."""

Check = Callable[[str, Any], None]


def whole(default: int | None, low: int, high: int) -> Any:
    """A whole number; None, too, if that is the default."""

    def holds(value: Any) -> bool:
        return (default is None and value is None) or _is_number(value, Integral, low, high)

    unset = " or unset" if default is None else ""
    return _field(default, holds, f"a whole number from {low} to {high}{unset}")


def wholes(default: tuple[int, ...], low: int, high: int, most: int) -> Any:
    """Up to so many whole numbers."""

    def holds(values: Any) -> bool:
        return _is_list(values, most) and all(_is_number(value, Integral, low, high) for value in values)

    return _field(default, holds, f"a list of up to {most} whole numbers from {low} to {high}")


def real(default: float, low: float, high: float) -> Any:
    """A number."""
    return _field(default, lambda value: _is_number(value, Real, low, high), f"a number from {low} to {high}")


def reals(default: tuple[float, ...], low: float, high: float) -> Any:
    """As many numbers as the default has."""
    count = len(default)

    def holds(values: Any) -> bool:
        return (
            _is_list(values, count)
            and len(values) == count
            and all(_is_number(value, Real, low, high) for value in values)
        )

    return _field(default, holds, f"{count} numbers from {low} to {high}")


def flag(default: bool) -> Any:
    """True or false."""
    return _field(default, lambda value: isinstance(value, bool), "true or false")


def choice(default: str, choices: Sequence[str]) -> Any:
    """One of a few words."""

    def check(name: str, value: Any) -> None:
        if value not in choices:
            raise InvalidChoice(name, value, choices)

    return field(default=default, metadata={CHECK: check})


def texts(most: int, longest: int) -> Any:
    """Up to so many texts, none by default."""

    def holds(values: Any) -> bool:
        return _is_list(values, most) and all(
            isinstance(value, str) and len(value) <= longest for value in values
        )

    return _field((), holds, f"a list of up to {most} texts of up to {longest} characters")


def check_fields(config: Any) -> None:
    """Check every field that was made here.

    Raises:
        BadConfig: a value is of another type, or out of its range.
        InvalidChoice: a word is none of the choices.
    """
    for each in fields(config):
        if check := each.metadata.get(CHECK):
            check(each.name, getattr(config, each.name))


def require_multiple(config: Any, name: str, divisor: int, why: str) -> None:
    """Check that a field is a multiple.

    Raises:
        BadConfig: it is not.
    """
    value = getattr(config, name)
    if value < divisor or value % divisor:
        raise BadConfig(f"{name}={value} must be a multiple of {divisor}: {why}")


def _field(default: Any, holds: Callable[[Any], bool], allowed: str) -> Any:
    def check(name: str, value: Any) -> None:
        if not holds(value):
            raise BadConfig(f"{name} is {value!r}, but must be {allowed}")

    return field(default=default, metadata={CHECK: check})


def _is_number(value: Any, kind: type, low: float, high: float) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool) and low <= value <= high


def _is_list(values: Any, most: int) -> bool:
    return isinstance(values, tuple | list) and len(values) <= most
