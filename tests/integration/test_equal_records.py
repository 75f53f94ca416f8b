"""A committed checkpoint is evaluated several times, and leaves the same bytes each time."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lerobot_bimanual.results.evaluation import EvaluationRecord

pytestmark = [pytest.mark.slow, pytest.mark.sim]

TASK = "handover_item_easy"
CHECKPOINT = Path(__file__).parents[2] / "results/checkpoints/peract2_on_all"
SEEDS = (2, 3)


def words(folder: Path, first_seed: int, episodes: int, asynchronous: bool) -> list[str]:
    """The command line of an evaluation two at a time that leaves its record in a folder."""
    return [
        "lerobot-eval",
        f"--policy.path={CHECKPOINT}",
        "--policy.device=cpu",
        "--env.type=bimanual",
        f"--env.task={TASK}",
        "--env.image_size=128",
        f"--env.results_dir={folder}",
        f"--eval.n_episodes={episodes}",
        "--eval.batch_size=2",
        f"--eval.use_async_envs={str(asynchronous).lower()}",
        f"--seed={first_seed}",
        f"--output_dir={folder / 'lerobot'}",
    ]


def evaluated_here(monkeypatch: pytest.MonkeyPatch, *arguments) -> None:
    from lerobot.scripts.lerobot_eval import main

    from lerobot_env_bimanual import BimanualEnvConfig  # noqa: F401  registers the type, whoever was imported first

    monkeypatch.setattr(sys, "argv", words(*arguments))
    main()


def record_in(folder: Path) -> Path:
    return folder / f"{TASK}_test_record.json"


def test_a_checkpoint_leaves_equal_bytes_in_a_fresh_process_side_by_side_and_after_other_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    fresh, later, side_by_side = (tmp_path / name for name in ("fresh", "later", "side_by_side"))
    program = Path(sys.executable).with_name("lerobot-eval")
    command = [program, *words(fresh, SEEDS[0], 2, asynchronous=False)[1:]]
    subprocess.run(command, check=True, capture_output=True, env=os.environ | {"HF_HUB_OFFLINE": "1"})
    evaluated_here(monkeypatch, later, SEEDS[0] - 2, 4, False)
    evaluated_here(monkeypatch, side_by_side, SEEDS[0], 2, True)

    assert record_in(fresh).read_bytes() == record_in(side_by_side).read_bytes()
    alone, among_others = (EvaluationRecord.read(record_in(folder)) for folder in (fresh, later))
    assert [episode.seed for episode in alone.episodes] == [*SEEDS]
    assert all(episode.keyposes > 1 for episode in alone.episodes)
    # One episode a line: whatever was played before leaves no trace in it.
    lines = {line.rstrip(",") for line in record_in(later).read_text().splitlines()}
    assert len(among_others.episodes) == 4
    assert {
        line.rstrip(",") for line in record_in(fresh).read_text().splitlines() if '"seed"' in line
    } <= lines
