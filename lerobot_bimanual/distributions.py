"""What the installed distributions add to this one through entry points, found without importing it."""

import importlib.util
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path


def entries(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group by name, sorted."""
    return {entry.name: entry for entry in sorted(entry_points(group=group), key=lambda entry: entry.name)}


def location(module: str) -> Path | None:
    """Where a module lies, without the suffix of a file; None if its distribution has no folder."""
    top, *inner = module.split(".")
    spec = importlib.util.find_spec(top)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(spec.submodule_search_locations[0], *inner)
