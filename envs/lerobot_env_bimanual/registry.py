"""Registries of tasks and axes of perturbation: names are known without importing anything, modules load on first use."""

from __future__ import annotations

import functools
import importlib
import logging
from collections.abc import Callable, Mapping

from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError

logger = logging.getLogger(__name__)


class Registry[T]:
    """Entries by name: those of this distribution, and those that other distributions announce.

    Args:
        kind: what an entry is called in error messages, such as "task".
        group: entry-point group of other distributions, with `name = "module.that.registers_it"`.
        own: name -> module of this distribution's entries; they win over announced ones of the same name.
        unknown: makes the error for a name that does not exist, given the name and all that do.
    """

    def __init__(
        self,
        kind: str,
        group: str,
        own: Mapping[str, str],
        unknown: Callable[[str, tuple[str, ...]], BimanualError],
    ):
        self._kind, self._group, self._own, self._unknown = kind, group, own, unknown
        self._entries: dict[str, T] = {}

    @functools.cached_property
    def modules(self) -> dict[str, str]:
        """Name of every entry that is found without an import -> the module that registers it."""
        announced = {name: entry.module for name, entry in entries(self._group).items()}
        return announced | dict(self._own)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all entries, sorted."""
        return tuple(sorted({*self.modules, *self._entries}))

    @property
    def loaded(self) -> Mapping[str, T]:
        """Entries whose modules have been imported, by name."""
        return self._entries

    def add(self, name: str, entry: T) -> None:
        """Register an entry.

        Raises:
            ValueError: another entry has the same name.
        """
        if name in self._entries:
            raise ValueError(f"another {self._kind} is called {name!r}; names must be unique")
        self._entries[name] = entry

    def get(self, name: str) -> T:
        """The entry called `name`; its module is imported on first use.

        Raises:
            BimanualError: no such entry, or its module cannot be imported or does not register it.
        """
        if name not in self.names:
            raise self._unknown(name, self.names)
        if name not in self._entries:
            module = self.modules[name]
            try:
                importlib.import_module(module)
            except Exception as error:  # another distribution's module may fail in any way
                raise BimanualError(
                    f"{self._kind} {name!r} cannot be loaded from module {module!r}{self._source(name)}: {error}"
                ) from error
            if name not in self._entries:
                raise BimanualError(
                    f"module {module!r}{self._source(name)} registers no {self._kind} called {name!r}; an entry point "
                    f"of the group {self._group!r} must have the name of its {self._kind}"
                )
        return self._entries[name]

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
                if name in self._own:
                    raise
                logger.warning("skipped: %s", error)
        return found

    def _source(self, name: str) -> str:
        """The distribution that announces an entry, for error messages; empty for this distribution's entries."""
        if name in self._own:
            return ""
        entry = entries(self._group).get(name)
        return f" of the distribution {entry.dist.name!r}" if entry and entry.dist else ""
