"""The benchmark from nothing to a result, and again after an interruption; every program of benchmarks/ runs."""

import io
import json
import runpy
import sys
from functools import partial
from pathlib import Path

import programs
import pytest
from rich.console import Console

from lerobot_bimanual.benchmark import run as benchmark
from lerobot_bimanual.benchmark.config import BenchmarkConfig
from lerobot_bimanual.benchmark.pipeline import Pipeline
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.files import sha256
from lerobot_bimanual.results.benchmark import BenchmarkResult

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def begun_by(plan: Plan) -> list[str]:
    """The commands that a benchmark begins, as they are shown."""
    console = Console(file=io.StringIO(), width=200, record=True)
    benchmark.run(plan, console)
    return [line.removeprefix("$ ") for line in console.export_text().splitlines() if line.startswith("$ ")]


def test_a_benchmark_gives_a_result_and_continues_after_an_interruption(tmp_path, tiny_flags, monkeypatch):
    """Programs are forked here; the benchmark of the README starts them as a user does."""
    monkeypatch.setattr(benchmark, "Pipeline", partial(Pipeline, call=programs.call))
    small = BenchmarkConfig(
        **{"demos": 2, "image_size": 32, "steps": 4, "save_freq": 2, "batch_size": 2},
        val_episodes=2,
        test_episodes=2,
        train_flags=" ".join([*tiny_flags["peract2"][1:], "--num_workers=0"]),
        eval_flags="--eval.batch_size=1",
        device="cpu",
        workers=1,
        output=tmp_path,
    )
    plan = Plan.of(small)
    begun = begun_by(plan)
    row = BenchmarkResult.read(plan.result)
    assert begun == [str(command) for command in plan.commands(row.checkpoint_step)]
    assert [validation.step for validation in row.validation] == [2, 4]
    assert [episode.seed for episode in row.episodes] == [0, 1]
    assert row.rates["expert"].rate == 1
    assert row.demonstrations.seeds == (0, 1)
    assert row.checkpoint_sha256 == sha256(plan.weights(row.checkpoint_step))

    plan.result.unlink()
    (plan.evaluation_folder("test", row.checkpoint_step) / "eval_info.json").unlink()
    assert begun_by(plan) == [str(plan.evaluation("test", row.checkpoint_step))]
    assert BenchmarkResult.read(plan.result).episodes == row.episodes
    assert BenchmarkResult.read(plan.result).training_seconds == row.training_seconds

    plan.result.unlink()
    marker = plan.run_folder / "train.command.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"done": False}))
    (resumed, *_) = begun_by(plan)
    assert resumed.startswith("lerobot-bimanual-train --config_path=")
    assert resumed.endswith("--resume=true")


BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SMALL = (
    "world.py observation --moments=1 --rounds=1 --image_size=32 --perturb=light:1",
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
