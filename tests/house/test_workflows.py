"""The workflows for GitHub call only `make` targets and scripts that exist, with few rights and bounded time."""

import os
import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
APT = "sudo apt-get update && sudo apt-get install -y libegl1 libegl-mesa0 libgl1-mesa-dri"


@pytest.mark.parametrize("path", sorted(ROOT.glob(".github/workflows/*.yml")), ids=lambda path: path.stem)
def test_a_workflow_is_thin_and_bounded(path: Path) -> None:
    workflow = yaml.safe_load(path.read_text())
    targets = set(re.findall(r"^([a-z-]+):.*## ", (ROOT / "Makefile").read_text(), re.MULTILINE))
    steps = [step for job in workflow["jobs"].values() for step in job["steps"]]
    for program, *words in (step["run"].split() for step in steps if step.get("run", APT) != APT):
        assert (
            set(words) <= targets
            if program == "make"
            else program == "grep" or os.access(ROOT / program, os.X_OK)
        )
    assert workflow["permissions"] == {"contents": "read"}
    assert all("timeout-minutes" in job or "environment" in job for job in workflow["jobs"].values())
    assert APT.rpartition("install -y ")[2] in (ROOT / "README.md").read_text()
