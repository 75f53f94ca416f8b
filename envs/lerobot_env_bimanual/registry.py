"""Registries of tasks and of axes of perturbation: names are known without importing anything, modules load on first use.

The axes are chosen by a text such as `camera_moved:2,mass:1`, which is checked here without loading MuJoCo.
"""

import functools
import importlib
import logging
import signal
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError, InvalidChoice, plain, shown
from lerobot_bimanual.perturbation_levels import levels_text, parse_levels

logger = logging.getLogger(__name__)


class Registry[T]:
    """Entries by name: those of this distribution, and those that other distributions announce.

    Args:
        kind: what an entry is called in error messages, such as "task".
        group: entry-point group of other distributions, with `name = "module.that.registers_it"`.
        own: name -> module of this distribution's entries; they win over announced ones of the same name.

    Attributes:
        own: as given.
        loaded: entries whose modules have been imported, by name.
    """

    def __init__(self, kind: str, group: str, own: Mapping[str, str]):
        self._kind, self._group, self.own = kind, group, own
        self.loaded: dict[str, T] = {}

    @functools.cached_property
    def modules(self) -> dict[str, str]:
        """Name of every entry that is found without an import -> the module that registers it."""
        announced = entries(self._group)
        for name in [name for name in announced if not name.isidentifier()]:
            named = self._kind, shown(name), self._source(name)
            logger.warning("skipped: the %s %s%s must be called by letters, digits and _ alone", *named)
            del announced[name]
        for name in announced.keys() & self.own.keys():
            distribution = announced[name].dist
            named = self._kind, name, distribution and distribution.name
            logger.warning(
                "ignored: the %s %r of the distribution %r has the name of a built-in one: rename it", *named
            )
        return {name: entry.module for name, entry in announced.items()} | dict(self.own)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all entries, sorted."""
        return tuple(sorted({*self.modules, *self.loaded}))

    def add(self, name: str, entry: T) -> None:
        """Register an entry.

        Raises:
            ValueError: another entry has the same name.
        """
        if name in self.loaded:
            raise ValueError(f"another {self._kind} is called {name!r}; names must be unique")
        self.loaded[name] = entry

    def get(self, name: str) -> T:
        """The entry called `name`; its module is imported on first use.

        Raises:
            BimanualError: no such entry, or its module cannot be imported or does not register it.
        """
        if name not in self.names:
            raise InvalidChoice(self._kind, name, self.names)
        if name not in self.loaded:
            module = self.modules[name]
            try:
                importlib.import_module(module)
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # another distribution's module may fail in any way
                if getattr(error, "code", None) == 128 + signal.SIGTERM:
                    raise
                raise BimanualError(
                    f"{self._kind} {name!r} cannot be loaded from module {module!r}{self._source(name)}: "
                    f"{type(error).__name__}: {plain(error)}"
                ) from error
            if name not in self.loaded:
                raise BimanualError(
                    f"module {module!r}{self._source(name)} registers no {self._kind} called {name!r}; an entry point "
                    f"of the group {self._group!r} must have the name of its {self._kind}"
                )
        return self.loaded[name]

    def all(self) -> dict[str, T]:
        """Every entry that can be loaded, by name; a broken one of another distribution is skipped with a warning.

        Raises:
            BimanualError: an entry of this distribution cannot be loaded.
        """
        found: dict[str, T] = {}
        for name in self.names:
            try:
                found[name] = self.get(name)
            except BimanualError as error:
                if name in self.own:
                    raise
                logger.warning("skipped: %s", error)
        return found

    def _source(self, name: str) -> str:
        """The distribution that announces an entry, for error messages; empty for this distribution's entries."""
        if name in self.own:
            return ""
        entry = entries(self._group).get(name)
        return f" of the distribution {entry.dist.name!r}" if entry and entry.dist else ""


AXES_DATA: Mapping[str, Mapping[str, Any]] = tomllib.loads(
    Path(__file__).with_name("perturbations").joinpath("axes.toml").read_text(encoding="utf-8")
)
"""Axis of this distribution -> its module in `perturbations`, and the arguments of `Axis` besides its functions."""

AXES: Registry[Any] = Registry(
    kind="axis",
    group="lerobot_bimanual.perturbations",
    own={name: f"{__package__}.perturbations.{row['module']}" for name, row in AXES_DATA.items()},
)
"""The axes of perturbation, each a `lerobot_env_bimanual.perturbations.axis.Axis`."""


def checked_perturbation(perturb: object) -> str:
    """The canonical text of the chosen levels, `AXIS:LEVEL` separated by commas, without nominal axes.

    Raises:
        InvalidChoice: the text has another form, or there is no such axis or level.
    """
    levels = parse_levels(perturb)
    for name in levels:
        if name not in AXES.names:
            raise InvalidChoice(f"an axis of perturb={perturb!r}", name, AXES.names)
    return levels_text(levels)
