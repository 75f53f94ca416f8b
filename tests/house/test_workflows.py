"""The workflows for GitHub are thin: they call what everybody calls, and it exists."""

import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
WORKFLOWS = sorted((ROOT / ".github/workflows").glob("*.yml"))
APT = "sudo apt-get update && sudo apt-get install -y libegl1 libegl-mesa0 libgl1-mesa-dri"


def jobs(workflow: Path) -> dict[str, dict[str, Any]]:
    return yaml.safe_load(workflow.read_text())["jobs"]


def steps(workflow: Path) -> list[dict[str, Any]]:
    return [step for job in jobs(workflow).values() for step in job["steps"]]


def make_targets() -> set[str]:
    return set(re.findall(r"^([a-z-]+):.*## ", (ROOT / "Makefile").read_text(), re.MULTILINE))


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_runs_make_targets_and_scripts_that_exist(workflow: Path) -> None:
    commands = [step["run"] for step in steps(workflow) if "run" in step]
    ours = [command for command in commands if command != APT and not command.startswith("grep ")]
    assert ours
    for command in ours:
        program, *words = command.split()
        if program == "make":
            assert set(words) <= make_targets()
        else:
            assert words == []
            assert os.access(ROOT / program, os.X_OK)


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_has_few_rights_and_bounded_time(workflow: Path) -> None:
    assert yaml.safe_load(workflow.read_text())["permissions"] == {"contents": "read"}
    for name, job in jobs(workflow).items():
        assert job["runs-on"] == "ubuntu-24.04", name
        assert "timeout-minutes" in job or "environment" in job, name
        assert set(job.get("needs", "").split()) <= jobs(workflow).keys()
    for step in steps(workflow):
        assert ("uses" in step) != ("run" in step)
        assert re.fullmatch(r"[\w-]+/[\w-]+@(v\d+|release/v1)", step.get("uses", "a/b@v1"))


def test_the_packages_of_a_machine_are_those_that_the_readme_names() -> None:
    assert (
        APT.partition("&& ")[2].removeprefix("sudo apt-get install -y ") in (ROOT / "README.md").read_text()
    )


def test_a_release_asks_whether_its_tag_is_the_version() -> None:
    (command,) = (step["run"] for step in steps(ROOT / ".github/workflows/release.yml") if "name" in step)
    for tag, fits in ((f"v{declared_version()}", True), ("v99.0", False)):
        done = subprocess.run(["bash", "-c", command], cwd=ROOT, env=os.environ | {"GITHUB_REF_NAME": tag})
        assert (done.returncode == 0) == fits


def declared_version() -> str:
    (version,) = re.findall(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    return version
