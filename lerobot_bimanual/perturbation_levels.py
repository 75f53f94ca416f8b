"""Perturbations as text: `camera_moved:2,mass:1`, empty if nominal."""

from collections.abc import Mapping

from lerobot_bimanual.errors import InvalidChoice

MAX_LEVEL = 3
"""Level 0 is nominal."""
LEVELS = tuple(range(1, MAX_LEVEL + 1))


def parse_levels(text: object, option: str = "perturb") -> dict[str, int]:
    """Level of each axis in `AXIS:LEVEL,...`, by name in alphabetical order; nominal axes are left out.

    Args:
        text: what was given.
        option: the name of the option that it was given as.

    Raises:
        InvalidChoice: it has another form, a level that there is not, or an axis twice.
    """
    form = f"empty, or AXIS:LEVEL with levels 0 to {MAX_LEVEL}, each axis once, as in 'camera_moved:2,mass:1'"
    if not isinstance(text, str):
        raise InvalidChoice(option, text, form)
    levels: dict[str, int] = {}
    for part in filter(None, map(str.strip, text.split(","))):
        name, colon, level = part.partition(":")
        if not (name.isidentifier() and colon and level in map(str, range(MAX_LEVEL + 1))) or name in levels:
            raise InvalidChoice(option, text, form)
        levels[name] = int(level)
    return {name: levels[name] for name in sorted(levels) if levels[name]}


def levels_text(levels: Mapping[str, int]) -> str:
    """The one text for these levels."""
    return ",".join(f"{name}:{levels[name]}" for name in sorted(levels) if levels[name])
