"""What a row of results can hold of the numbers that are asked for; found out before anything runs."""

import re

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import shown

MOST = 10**9 - 1
"""Of every number of a training; rows hold no longer ones."""
MOST_SEED = {"seed": MOST, "first_seed": 2**32 - 1}
"""The largest by flag; LeRobot seeds NumPy with the second."""


def check_number(name: str, number: int, least: int, most: int = MOST) -> None:
    """Refuse a number out of range.

    Raises:
        BimanualError: it is.
    """
    if not least <= number <= most:
        raise BimanualError(f"{name} is {shown(number)}, but must be from {least} to {most}")


def variation_name(text: str) -> str:
    """`any`, or the index of a variation as rows write it: `0` for `00`.

    Raises:
        BimanualError: it is neither.
    """
    if text == "any":
        return text
    if not re.fullmatch("[0-9]{1,4}", text):
        raise BimanualError(f"variation is {shown(text)}, but must be an index of up to four digits, or any")
    return str(int(text))
