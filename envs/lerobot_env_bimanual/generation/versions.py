"""Whether the installed simulation is the one that made a dataset."""

from __future__ import annotations

from collections.abc import Mapping

from lerobot_bimanual.dataset.provenance import SIMULATION_PACKAGES, Provenance, installed_versions


def other_versions(provenance: Provenance) -> Mapping[str, tuple[str, str]]:
    """Packages that decide what a seed means and differ: package -> (recorded, installed) version."""
    installed = installed_versions()
    return {
        package: (recorded, installed[package])
        for package in SIMULATION_PACKAGES
        if (recorded := provenance.versions.get(package, "none")) != installed[package]
    }
