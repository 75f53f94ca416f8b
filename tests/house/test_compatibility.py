"""Versions that are refused by name, and ranges that the documents state."""

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
PYPROJECTS = (ROOT / "pyproject.toml", *ROOT.glob("*/pyproject.toml"))
PROJECTS = [tomllib.loads(path.read_text())["project"] for path in PYPROJECTS]
REQUIREMENTS = [
    Requirement(line)
    for project in PROJECTS
    for lines in (project["dependencies"], *project.get("optional-dependencies", {}).values())
    for line in lines
]


def test_every_distribution_that_names_mujoco_excludes_4_0_0_by_name() -> None:
    named = [requirement for requirement in REQUIREMENTS if requirement.name == "mujoco"]
    assert named
    assert all("!=4.0.0" in str(requirement.specifier) for requirement in named)


def test_the_page_of_compatibility_states_the_declared_ranges() -> None:
    page = (ROOT / "docs/compatibility.md").read_text()
    stated = dict(re.findall(r"^\| `([\w-]+)` \| `([^`]+)` \|", page, re.MULTILINE))
    declared = {
        name: {str(found.specifier) for found in REQUIREMENTS if found.name.lower() == name}
        for name in ("lerobot", "mujoco", "gymnasium", "torch", "transformers", "numpy", "av")
    }
    assert {name: {range_} for name, range_ in stated.items()} == declared
