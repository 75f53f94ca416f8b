"""Config fields that check their values, so that a range is written once, beside the default.

The ranges are wide. They exclude what cannot work, and sizes that would fill the memory of a machine.
"""

from dataclasses import field, fields
from numbers import Integral, Real
from typing import Any

from lerobot_bimanual.errors import InvalidChoice
from lerobot_policy_bimanual.errors import BadConfig

CHECK = "check"
"""Key of a field's check in its metadata."""


def number(default: float | tuple[float, ...] | None, low: float, high: float, unset: bool = False) -> Any:
    """Make a field for a number of the default's type, or for as many numbers as the default has.

    Args:
        default: a default with a fraction, such as 1.0, allows any real number; others allow whole numbers. `low` tells
            the type if it is None.
        low: smallest value.
        high: largest value.
        unset: whether None is allowed, too.
    """
    shown = default if isinstance(default, tuple) else (low if default is None else default,)
    kind, word = (Real, "number") if isinstance(shown[0], float) else (Integral, "whole number")
    many = f"{len(shown)} {word}s" if isinstance(default, tuple) else f"a {word}"

    def check(name: str, value: Any) -> None:
        values = value if isinstance(default, tuple) else (value,)
        if value is None and unset:
            return
        if not isinstance(values, tuple | list) or len(values) != len(shown) or not all(map(holds, values)):
            raise BadConfig(
                f"{name} is {value!r}, but must be {many} from {low} to {high}{' or unset' * unset}"
            )

    def holds(value: Any) -> bool:
        return isinstance(value, kind) and not isinstance(value, bool) and low <= value <= high  # pyright: ignore[reportOperatorIssue]

    return field(default=default, metadata={CHECK: check})


def choice(*choices: str) -> Any:
    """Make a field for one of a few words; the first is the default."""

    def check(name: str, value: Any) -> None:
        if value not in choices:
            raise InvalidChoice(name, value, choices)

    return field(default=choices[0], metadata={CHECK: check})


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
    """Refuse a field that is not a multiple of the divisor, as `BadConfig`."""
    value = getattr(config, name)
    if value < divisor or value % divisor:
        raise BadConfig(f"{name}={value} must be a multiple of {divisor}: {why}")


def require_dilations(config: Any, name: str) -> None:
    """Refuse a field that is not a short list of dilations, as `BadConfig`."""
    values = getattr(config, name)
    if len(values) > 16 or not all(isinstance(each, int) and 1 <= each <= 512 for each in values):
        raise BadConfig(f"{name} is {values!r}, but must be a list of up to 16 whole numbers from 1 to 512")
