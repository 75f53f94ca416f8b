"""Ranges of seeds as users write them."""

from __future__ import annotations

import re

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import shown

MOST_DIGITS = 9


def parse_seeds(text: str) -> range:
    """The half-open range `a:b` of seeds.

    Raises:
        BimanualError: the text is not such a range, or the range is empty.
    """
    found = re.fullmatch(f"([0-9]{{1,{MOST_DIGITS}}}):([0-9]{{1,{MOST_DIGITS}}})", text)
    seeds = range(int(found[1]), int(found[2])) if found else range(0)
    if not seeds:
        raise BimanualError(f"seeds is {shown(text)}, but must be a half-open range such as 0:100")
    return seeds
