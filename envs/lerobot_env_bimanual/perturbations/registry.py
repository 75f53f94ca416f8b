"""The axes of perturbation by name, and the text that chooses some: `camera_moved:2,mass:1`.

Names are known without loading MuJoCo, so that options can be checked quickly.
"""

from __future__ import annotations

import tomllib
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.perturbation_levels import levels_text, parse_levels
from lerobot_env_bimanual.registry import Registry

if TYPE_CHECKING:
    from lerobot_env_bimanual.perturbations.axis import Axis

PERTURBATIONS_GROUP = "lerobot_bimanual.perturbations"
"""Entry-point group of axes in other distributions: `name_of_the_axis = "module.that.registers_it"`."""

_DATA = tomllib.loads(Path(__file__).with_name("axes.toml").read_text(encoding="utf-8"))

AXES: Registry[Axis[Any]] = Registry(
    kind="axis",
    group=PERTURBATIONS_GROUP,
    own={name: f"{__package__}.{row['module']}" for name, row in _DATA.items()},
    unknown=partial(InvalidChoice, "axis"),
)


def data(name: str) -> dict[str, Any]:
    """The arguments of `Axis` besides its functions, from `axes.toml`, for an axis of this package."""
    row = {key: value for key, value in _DATA[name].items() if key != "module"}
    return row | {"name": name, "levels": tuple(row["levels"])}


def register[Memory](axis: Axis[Memory]) -> Axis[Memory]:
    """Add an axis to the registry, and return it.

    Raises:
        ValueError: another axis has the same name.
    """
    AXES.add(axis.name, axis)
    return axis


def list_axes() -> tuple[str, ...]:
    """Names of all axes, sorted."""
    return AXES.names


def get_axis(name: str) -> Axis[Any]:
    """The axis called `name`.

    Raises:
        InvalidChoice: no such axis; the message lists those that exist.
        BimanualError: it belongs to another distribution, and cannot be loaded.
    """
    return AXES.get(name)


def chosen_levels(perturb: object) -> dict[str, int]:
    """Level of each chosen axis, by name in alphabetical order; nominal axes are left out.

    Args:
        perturb: `AXIS:LEVEL`, several separated by commas; may be empty.

    Raises:
        InvalidChoice: the text has another form, or there is no such axis or level.
    """
    levels = parse_levels(perturb)
    for name in levels:
        if name not in list_axes():
            raise InvalidChoice(f"an axis of perturb={perturb!r}", name, list_axes())
    return levels


def checked_perturbation(perturb: object) -> str:
    """The canonical text of the chosen levels.

    Raises:
        InvalidChoice: as for `chosen_levels`.
    """
    return levels_text(chosen_levels(perturb))
