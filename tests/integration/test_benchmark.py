"""The benchmark verb from nothing to a result, and again after an interruption."""

import json
from pathlib import Path

import pytest

from lerobot_bimanual.benchmark import pipeline
from lerobot_bimanual.benchmark.pipeline import sha256
from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.commands.benchmark import benchmark
from lerobot_bimanual.errors import BimanualError

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def test_a_benchmark_gives_a_result_and_continues_after_an_interruption(
    tmp_path: Path, monkeypatch, tiny_flags
):
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
    benchmark(config)
    row = ResultRow.read(plan.result)
    assert [validation.step for validation in row.validation] == [2, 4]
    assert [episode.seed for episode in row.episodes] == [0, 1]
    assert row.rates["expert"].rate == 1
    assert row.dataset.seeds == (0, 1)
    assert row.checkpoint_sha256 == sha256(plan.weights(row.checkpoint_step))
    assert row.training_seconds > 0

    commands: list[list[str]] = []
    call = pipeline._call

    def recorded(words: list[str]) -> int:
        commands.append(words)
        return call(words)

    monkeypatch.setattr(pipeline, "_call", recorded)
    plan.result.unlink()
    plan.evaluation_file("test", row.checkpoint_step).unlink()
    benchmark(config)
    assert [words[0] for words in commands] == ["lerobot-eval"]
    assert ResultRow.read(plan.result).episodes == row.episodes
    assert ResultRow.read(plan.result).training_seconds == row.training_seconds

    marker = plan.run_folder / "train.stage.json"
    marker.write_text(json.dumps(json.loads(marker.read_text()) | {"done": False}))
    monkeypatch.setattr(pipeline, "_call", lambda words: commands.append(words) or 1)
    with pytest.raises(BimanualError, match="stage 'train' failed"):
        benchmark(config)
    assert commands[-1][0] == "lerobot-bimanual-train"
    assert commands[-1][-1] == "--resume=true"
