"""Versions of the packages that decide which episode a seed means; every dataset and every result names them."""

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

from pydantic import Field

Version = Annotated[str, Field(pattern=r"^[\w.+!-]{1,40}$")]
"""A version; error messages put it into commands, so it can hold nothing else."""

SIMULATION_PACKAGES = ("lerobot_bimanual", "lerobot_env_bimanual", "mujoco", "frankik", "numpy")
"""Packages whose versions decide which episode a seed means."""

STAMPED_PACKAGES = (*SIMULATION_PACKAGES, "lerobot")
"""Packages whose versions are recorded."""


def installed_versions(packages: Sequence[str] = STAMPED_PACKAGES) -> dict[str, str]:
    """Versions of packages in this process; "none" for one that is not installed."""
    versions = {}
    for package in packages:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "none"
    return versions
