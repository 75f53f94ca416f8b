"""LeRobot's own evaluation plays several tasks at the same time."""

from pathlib import Path

import pytest
from programs import run

pytestmark = pytest.mark.slow

SHIPPED = Path(__file__).parents[2] / "results/checkpoints/peract2_on_all"


def records(folder: Path, *flags: str) -> dict[str, bytes]:
    """The records of two short episodes of two tasks by their file's name, evaluated with further flags."""
    policy = (f"--policy.path={SHIPPED}", "--policy.device=cpu", "--env.type=bimanual")
    env = ("--env.task=push_box,lift_ball", "--env.image_size=128", "--env.max_keyposes=1")
    counts = ("--eval.n_episodes=2", "--eval.batch_size=2")
    output = (f"--env.results_dir={folder}", f"--output_dir={folder}")
    run("lerobot-eval", *policy, *env, *counts, *output, *flags, folder=folder)
    return {path.name: path.read_bytes() for path in folder.glob("*_record.json")}


def test_tasks_that_are_evaluated_at_the_same_time_are_played_as_one_after_the_other(tmp_path):
    one_by_one, in_threads, in_processes = (tmp_path / name for name in ("one", "threads", "processes"))
    for folder in (one_by_one, in_threads, in_processes):
        folder.mkdir()
    expected = records(one_by_one, "--eval.use_async_envs=false")
    assert {"push_box_test_record.json", "lift_ball_test_record.json"} <= expected.keys()
    together = "--env.max_parallel_tasks=2"
    assert records(in_threads, together, "--eval.use_async_envs=false") == expected
    assert records(in_processes, together, "--eval.use_async_envs=true") == expected
