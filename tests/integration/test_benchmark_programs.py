"""Every program in benchmarks/ runs, with numbers so small that what it says means nothing."""

import json
import runpy
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
PROGRAMS = sorted(path.name for path in BENCHMARKS.glob("*.py") if "__main__" in path.read_text("utf-8"))

SMALL = {
    "learning.py": "--policies peract2 --turns=1 --steps=1",
    "loading.py": "--demos=1 --image_size=32 --runs keyframes --reads=1 --loaders",
    "merging.py": "--shards=2",
    "observation.py": "--tasks=lift_ball --rounds=1 --moments=1",
    "perturbations.py": "--levels=1 --moments=1 --rounds=1",
    "planning.py": "--problems=1 --draws=1 --rounds=1",
    "policies.py": "--voxels=10 --stages --repeats=1",
    "recording.py": "--demos=1 --image_size=32 --workers",
    "renderer.py": "--repeats=1",
    "scoring.py": "--tasks=lift_ball --episodes=1",
    "simulation.py": "--image_size=32 --repeats=1 --episodes=1",
    "starting.py": "--only=tasks --turns=1",
}
"""Flags of each, for a test of seconds."""


@pytest.mark.parametrize("program", PROGRAMS)
def test_every_benchmark_runs_and_ends_with_its_figures(program, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(BENCHMARKS)
    monkeypatch.setattr(sys, "argv", [program, *SMALL[program].split()])
    runpy.run_path(str(BENCHMARKS / program), run_name="__main__")
    assert json.loads(capfd.readouterr().out.splitlines()[-1])
