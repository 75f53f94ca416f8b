"""Which perturbations are chosen, as text such as `camera_moved:2,mass:1`.

Nothing is imported here but names, so that options can be read without loading MuJoCo.
"""

import functools
import pkgutil
from pathlib import Path

from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import InvalidChoice

PERTURBATIONS_GROUP = "lerobot_bimanual.perturbations"
"""Entry-point group of axes in other distributions: `name_of_the_axis = "module.that.registers_it"`."""

MAX_LEVEL = 3
"""Level 0 is the world as it is."""

_ROOM = "lerobot_env_bimanual.perturbations.axes"
_FOLDER = Path(__file__).parent / "perturbations" / "axes"


@functools.cache
def axis_modules() -> dict[str, str]:
    """Name of every axis and the module that registers it; an axis of this distribution wins over one of its name."""
    announced = {name: entry.module for name, entry in entries(PERTURBATIONS_GROUP).items()}
    here = (module.name for module in pkgutil.iter_modules([str(_FOLDER)]))
    return announced | {name: f"{_ROOM}.{name}" for name in sorted(here) if not name.startswith("_")}


def parse_perturbations(text: object) -> dict[str, int]:
    """Level of each chosen axis, by name in alphabetical order; axes at level 0 are left out.

    Args:
        text: `AXIS:LEVEL`, several separated by commas; may be empty.

    Raises:
        InvalidChoice: an axis or level that there is not, or an axis named twice.
    """
    if not isinstance(text, str):
        raise InvalidChoice("perturb", text, ["a text such as 'camera_moved:2,mass:1'"])
    chosen: dict[str, int] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, colon, level = part.partition(":")
        if name not in axis_modules():
            raise InvalidChoice(f"the axis of perturb={text!r}", name, sorted(axis_modules()))
        if not colon or level not in map(str, range(MAX_LEVEL + 1)):
            choices = [f"{name}:{level}" for level in range(MAX_LEVEL + 1)]
            raise InvalidChoice(f"the level in perturb={text!r}", part, choices)
        if name in chosen:
            raise InvalidChoice("perturb", text, [f"a text that names {name} once"])
        chosen[name] = int(level)
    return {name: chosen[name] for name in sorted(chosen) if chosen[name]}


def perturbation_text(levels: dict[str, int]) -> str:
    """The one text for these levels; empty for the world as it is."""
    return ",".join(f"{name}:{levels[name]}" for name in sorted(levels) if levels[name])
