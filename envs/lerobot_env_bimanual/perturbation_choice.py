"""Which perturbations there are to choose from, by name.

Nothing is imported here but names, so that options can be read without loading MuJoCo.
"""

import functools
import pkgutil
from pathlib import Path

from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.perturbation_levels import levels_text, parse_levels

PERTURBATIONS_GROUP = "lerobot_bimanual.perturbations"
"""Entry-point group of axes in other distributions: `name_of_the_axis = "module.that.registers_it"`."""

_ROOM = "lerobot_env_bimanual.perturbations.axes"
_FOLDER = Path(__file__).parent / "perturbations" / "axes"


@functools.cache
def axis_modules() -> dict[str, str]:
    """Name of every axis and the module that registers it; an axis of this distribution wins over one of its name."""
    announced = {name: entry.module for name, entry in entries(PERTURBATIONS_GROUP).items()}
    here = (module.name for module in pkgutil.iter_modules([str(_FOLDER)]))
    return announced | {name: f"{_ROOM}.{name}" for name in sorted(here) if not name.startswith("_")}


def chosen_levels(perturb: object) -> dict[str, int]:
    """Level of each chosen axis, by name in alphabetical order; axes at level 0 are left out.

    Args:
        perturb: `AXIS:LEVEL`, several separated by commas; may be empty.

    Raises:
        InvalidChoice: the text has another form, or there is no such axis or level.
    """
    levels = parse_levels(perturb)
    for name in levels:
        if name not in axis_modules():
            raise InvalidChoice(f"an axis of perturb={perturb!r}", name, sorted(axis_modules()))
    return levels


def checked_perturbation(perturb: object) -> str:
    """The one text for the chosen levels.

    Raises:
        InvalidChoice: as for `chosen_levels`.
    """
    return levels_text(chosen_levels(perturb))
