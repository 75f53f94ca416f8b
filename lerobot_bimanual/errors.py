"""Errors that users see: each says what was got, what is allowed and how to go on.

A message may contain text of a file, which is made harmless where it is printed, on a terminal or in a page.
"""

import difflib
from collections.abc import Iterable
from typing import Any

MAX_TEXT = 200
"""Characters of one text of a file that are printed."""
MAX_MESSAGE = 4000
"""Characters of an error: none of ours is as long, but with a text of a file in it."""


class BimanualError(Exception):
    """Base of all errors raised on purpose; the command line prints them as one line.

    Attributes:
        exit_code: of a program that it ends.
    """

    exit_code = 1

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the message itself; by default, unpickling would call the constructor with it."""
        return type(self).__new__, (type(self), *self.args), vars(self)


def plain(text: object, limit: int = MAX_TEXT) -> str:
    r"""A text on one line, cut to a length, its control characters written out as `\x1b`."""
    text = str(text)
    text = text if len(text) <= limit else f"{text[:limit]}..."
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def shown(value: object) -> str:
    """The representation of a value, for a sentence: quotes tell where a text begins and ends."""
    return plain(repr(value[: MAX_TEXT + 1] if isinstance(value, str | bytes) else value))


def did_you_mean(name: object, valid: Iterable[str]) -> str:
    """A sentence with the valid name that is nearest to a wrong one, after a space; "" if none is near."""
    word = name if isinstance(name, str) and len(name) <= MAX_TEXT else ""
    close = difflib.get_close_matches(word, list(valid), n=1)
    return f" Did you mean {close[0]!r}?" if close else ""


class InvalidChoice(BimanualError):
    """An option set to a value that it cannot have.

    Args:
        option: name of the option.
        value: what it was set to.
        valid: the names that it can have, or a text that describes its values, such as "1 to 100".
    """

    def __init__(self, option: str, value: object, valid: str | Iterable[str]):
        if isinstance(valid, str):
            super().__init__(f"{option} is {shown(value)}, but must be {valid}")
        else:
            names = list(valid)
            guess = did_you_mean(value, names)
            super().__init__(
                f"{option} is {shown(value)}, but must be one of: {', '.join(names)}{guess and '.'}{guess}"
            )


def check_range(option: str, value: float, minimum: float) -> None:
    """Refuse a number below its minimum by an `InvalidChoice`."""
    if value < minimum:
        raise InvalidChoice(option, value, f"at least {minimum}")


class InvalidAction(BimanualError):
    """An action that no mode of the environment can execute."""


class PlacementFailure(BimanualError):
    """No placement of the props was found that both arms can serve."""


class DatasetError(BimanualError):
    """A dataset that cannot be written, resumed, merged or read, or that is not of the schema of this package."""
