"""The one list of axes; the ladder, its certificates, documentation and tests are derived from it."""

from __future__ import annotations

import importlib

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_env_bimanual.perturbation_choice import PERTURBATIONS_GROUP, axis_modules
from lerobot_env_bimanual.perturbations.axis import Axis

_AXES: dict[str, type[Axis]] = {}


def register[A: Axis](axis_class: type[A]) -> type[A]:
    """Class decorator: add an axis to the registry.

    Raises:
        ValueError: another axis has the same name.
    """
    if axis_class.name in _AXES:
        raise ValueError(f"there is another axis called {axis_class.name!r}; names must be unique")
    _AXES[axis_class.name] = axis_class
    return axis_class


def list_axes() -> tuple[str, ...]:
    """Names of all axes, sorted."""
    return tuple(sorted({*axis_modules(), *_AXES}))


def get_axis(name: str) -> Axis:
    """The axis called `name`.

    Raises:
        InvalidChoice: no such axis; the message lists those that exist.
        BimanualError: it is one of somebody else's, and cannot be loaded.
    """
    if name not in list_axes():
        raise InvalidChoice("axis", name, list_axes())
    if name not in _AXES:
        module = axis_modules()[name]
        try:
            importlib.import_module(module)
        except Exception as error:  # somebody else's module may fail in any way
            raise BimanualError(f"axis {name!r} cannot be loaded from module {module!r}: {error}") from error
        if name not in _AXES:
            raise BimanualError(
                f"module {module!r} registers no axis called {name!r}; a file in perturbations/axes/, or an entry point "
                f"of the group {PERTURBATIONS_GROUP!r}, bears the name of its axis"
            )
    return _AXES[name]()
