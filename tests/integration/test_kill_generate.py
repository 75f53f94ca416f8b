"""Killed at any moment, generation goes on where it stopped, ends with the same dataset and leaves nothing behind."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from worker_jobs import processes_of

pytestmark = [pytest.mark.weekly, pytest.mark.timeout(1800)]

FLAGS = (
    *("--task=lift_ball", "--episodes=3", "--view=both", "--image_size=24x32", "--cameras=front,left_wrist"),
    *("--intermediate=0.5", "--episodes_per_shard=1", "--repo_id=local/small", "--workers=2"),
)
TIMEOUT_S = 60.0
"""Within which orphans must be gone."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> tuple[Path, float]:
    """A dataset, and how long it took to generate it, in seconds."""
    root, start = tmp_path_factory.mktemp("undisturbed") / "small", time.monotonic()
    assert start_run(root).wait() == 0
    return root, time.monotonic() - start


@pytest.mark.parametrize(("victim", "shares"), [("parent", (0.6, 0.95)), ("all", (0.9,))])
def test_killed_runs_lose_only_what_was_unfinished(victim, shares, undisturbed, tree_hashes, tmp_path):
    (expected, duration_s), root = undisturbed, tmp_path / "small"
    rng = np.random.default_rng()  # other moments in every run of the test
    kept: dict[str, float] = {}
    for share in shares:  # imports take the first third
        run = start_run(root)
        with contextlib.suppress(subprocess.TimeoutExpired):
            run.wait(timeout=share * duration_s * rng.uniform(0.8, 1.0))
        kill(run, victim)
        shards = {it.name: it.stat().st_mtime for it in root.with_name("small.partial").glob("shards/*")}
        assert root.exists() or kept.items() <= shards.items(), "a finished shard was recorded again"
        kept = shards
    assert start_run(root).wait() == 0
    assert tree_hashes(root) == tree_hashes(expected)
    assert [path.name for path in root.parent.iterdir()] == ["small"]


def test_a_killed_worker_changes_nothing(undisturbed, tree_hashes, tmp_path):
    run = start_run(tmp_path / "small")
    # The run itself, a resource tracker, the fork server and two workers.
    while len(processes := processes_of(run.pid)) < 5:
        assert run.poll() is None, "it ended before it had workers"
        time.sleep(0.02)
    os.kill(max(processes), signal.SIGKILL)
    assert run.wait() == 0
    assert tree_hashes(tmp_path / "small") == tree_hashes(undisturbed[0])


def start_run(root: Path) -> subprocess.Popen:
    words = ["-m", "lerobot_bimanual.cli", "dataset", "generate", f"--root={root}", *FLAGS]
    return subprocess.Popen(
        [sys.executable, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def kill(run: subprocess.Popen, victim: str, number: signal.Signals = signal.SIGKILL) -> None:
    """Kill a run, and wait until its workers have ended."""
    with contextlib.suppress(ProcessLookupError):
        (os.kill if victim == "parent" else os.killpg)(run.pid, number)
    run.wait()
    deadline = time.monotonic() + TIMEOUT_S
    while left := processes_of(run.pid):
        assert time.monotonic() < deadline, f"left over: {left}"
        time.sleep(0.1)
