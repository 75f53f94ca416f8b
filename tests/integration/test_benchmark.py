"""The benchmark from nothing to a result, and again after an interruption."""

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.benchmark.run import run
from lerobot_bimanual.checksums import sha256

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def begun_by(plan: Plan) -> list[str]:
    """The commands that a benchmark begins, as they are shown."""
    console = Console(file=io.StringIO(), width=200, record=True)
    run(plan, console)
    return [line.removeprefix("$ ") for line in console.export_text().splitlines() if line.startswith("$ ")]


def test_a_benchmark_gives_a_result_and_continues_after_an_interruption(tmp_path: Path, tiny_flags):
    config = BenchmarkConfig(
        demos=2,
        image_size=32,
        steps=4,
        save_freq=2,
        batch_size=2,
        val_episodes=2,
        test_episodes=2,
        train_flags=" ".join([*tiny_flags["peract2"][1:], "--num_workers=0"]),
        eval_flags="--eval.batch_size=1",
        device="cpu",
        workers=1,
        output=tmp_path,
    )
    plan = Plan.of(config)
    begun = begun_by(plan)
    row = ResultRow.read(plan.result)
    assert begun == [str(command) for command in plan.commands(row.checkpoint_step)]
    assert [validation.step for validation in row.validation] == [2, 4]
    assert [episode.seed for episode in row.episodes] == [0, 1]
    assert row.rates["expert"].rate == 1
    assert row.dataset.seeds == (0, 1)
    assert row.checkpoint_sha256 == sha256(plan.weights(row.checkpoint_step))
    assert row.training_seconds > 0

    plan.result.unlink()
    plan.evaluation_file("test", row.checkpoint_step).unlink()
    assert begun_by(plan) == [str(plan.evaluation("test", row.checkpoint_step))]
    assert ResultRow.read(plan.result).episodes == row.episodes
    assert ResultRow.read(plan.result).training_seconds == row.training_seconds

    marker = plan.run_folder / "train.command.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"done": False}))
    (resumed, *_) = begun_by(plan)
    assert resumed.startswith("lerobot-bimanual-train --config_path=")
    assert resumed.endswith("--resume=true")
