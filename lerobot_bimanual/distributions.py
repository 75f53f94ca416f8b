"""Installed distributions: their versions, entry points and missing requirements, found without importing them."""

import importlib.util
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import EntryPoint, PackageNotFoundError, entry_points, requires, version
from pathlib import Path

from lerobot_bimanual.errors import BimanualError

SIMULATION_PACKAGES = ("lerobot_bimanual", "lerobot_env_bimanual", "mujoco", "frankik", "numpy")
"""Packages whose versions decide which episode a seed means."""

C_LIBRARY = "libc"
"""Its mathematical functions decide the last bits of states (docs/determinism.md)."""

STAMPED_PACKAGES = (*SIMULATION_PACKAGES, "lerobot", C_LIBRARY)
"""Packages, and the C library, whose versions are recorded."""


def installed_version(package: str) -> str | None:
    """The version of a package; None if it is not installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def installed_versions(packages: Sequence[str] = STAMPED_PACKAGES) -> dict[str, str]:
    """Versions of packages in this process; "none" for one that is not installed."""
    versions = {package: installed_version(package) or "none" for package in packages}
    if C_LIBRARY in packages:
        versions[C_LIBRARY] = "-".join(platform.libc_ver()).strip("-") or "none"
    return versions


def libc_mismatch(versions: Mapping[str, str]) -> str:
    """A note that the recorded C library differs from that of this process; empty if it is equal or was not recorded."""
    here = installed_versions([C_LIBRARY])[C_LIBRARY]
    made = versions.get(C_LIBRARY, here)
    return "" if made == here else f"made with the C library {made} (here: {here}), so last bits may differ"


def entries(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group by name, sorted; without those that name no module."""
    found = sorted(entry_points(group=group), key=lambda entry: entry.name)
    return {entry.name: entry for entry in found if entry.pattern.match(entry.value)}


def module_path(module: str) -> Path | None:
    """Where a module lies, without the suffix of a file; None if its distribution has no folder."""
    top, *inner = module.split(".")
    spec = importlib.util.find_spec(top)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(spec.submodule_search_locations[0], *inner)


def missing(distribution: str, extra: str) -> list[str]:
    """Distributions that an extra of an installed distribution needs and that are not installed."""
    from packaging.requirements import Requirement

    lacking: list[str] = []
    for requirement in map(Requirement, requires(distribution) or []):
        marker = requirement.marker
        if marker is None or marker.evaluate({"extra": ""}) or not marker.evaluate({"extra": extra}):
            continue
        if installed_version(requirement.name) is None:
            lacking.append(requirement.name)
        else:
            lacking += [name for inner in requirement.extras for name in missing(requirement.name, inner)]
    return lacking


def require_extras(entry: EntryPoint) -> None:
    """Refuse a command whose extras, which its entry point names, are not installed.

    Raises:
        BimanualError: the message says what to install.
    """
    owner = "" if entry.dist is None else entry.dist.name
    for extra in entry.extras if owner else ():
        if lacking := missing(owner, extra):
            raise BimanualError(
                f"`{entry.name}` needs {', '.join(lacking[:3])}, which is not installed: pip install '{owner}[{extra}]'"
            )
