"""Every benchmark runs, with numbers so small that its figures mean nothing."""

import json
import runpy
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SMALL = (
    "commands.py decoding --episodes=1 --image_size=32 --rounds=1",
    "policies.py --policies peract2 --rounds=1",
    "world.py observation --moments=1 --rounds=1 --image_size=32 --perturb=light:1",
    "world.py planning --problems=1",
    "world.py simulation --rounds=1 --resets=1",
)


@pytest.mark.parametrize("command", SMALL)
def test_every_benchmark_runs_and_ends_with_its_figures(command, tmp_path, monkeypatch, capfd):
    program = command.split()[0]
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(BENCHMARKS)
    monkeypatch.setattr(sys, "argv", command.split())
    runpy.run_path(str(BENCHMARKS / program), run_name="__main__")
    assert json.loads(capfd.readouterr().out.splitlines()[-1])["figures"]
