"""The workflows for GitHub call only `make` targets and scripts that exist, with few rights and bounded time."""

import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
WORKFLOWS = {
    path.stem: yaml.safe_load(path.read_text()) for path in (ROOT / ".github/workflows").glob("*.yml")
}
APT = "sudo apt-get update && sudo apt-get install -y libegl1 libegl-mesa0 libgl1-mesa-dri"


def steps(workflow: str) -> list[dict[str, Any]]:
    return [step for job in WORKFLOWS[workflow]["jobs"].values() for step in job["steps"]]


@pytest.mark.parametrize("name", WORKFLOWS)
def test_a_workflow_is_thin_and_bounded(name: str) -> None:
    targets = set(re.findall(r"^([a-z-]+):.*## ", (ROOT / "Makefile").read_text(), re.MULTILINE))
    commands = [step["run"].split() for step in steps(name) if "run" in step and step["run"] != APT]
    for program, *words in commands:
        if program == "make":
            assert set(words) <= targets
        elif program != "grep":
            assert os.access(ROOT / program, os.X_OK)
    assert WORKFLOWS[name]["permissions"] == {"contents": "read"}
    assert all("timeout-minutes" in job or "environment" in job for job in WORKFLOWS[name]["jobs"].values())


def test_the_packages_of_a_machine_are_those_that_the_readme_names() -> None:
    packages = APT.rpartition("install -y ")[2]
    assert packages in (ROOT / "README.md").read_text()


def test_a_release_is_refused_unless_its_tag_is_the_version() -> None:
    (command,) = (step["run"] for step in steps("release") if "name" in step)
    (version,) = re.findall(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    for tag, fits in ((f"v{version}", True), ("v99.0", False)):
        done = subprocess.run(["bash", "-c", command], cwd=ROOT, env=os.environ | {"GITHUB_REF_NAME": tag})
        assert (done.returncode == 0) == fits
