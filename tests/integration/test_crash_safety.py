"""Killed at any moment, generation goes on where it stopped and ends with the same dataset."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

pytestmark = [pytest.mark.slow, pytest.mark.sim]

KILL_WHEN = {"tmp-*/frames": 0.5, "shards/000000": 0.2, "tmp-*/dataset": 0.05}
"""What appears while the first shard is recorded, after it, and while shards are merged, and for how many seconds at most
the run is let go on from there; what follows takes seconds, 0.3 s and 0.15 s."""

DRILL = Path(__file__).with_name("crash_drill.py")
KILLS = 8
SEED = 20


@pytest.mark.timeout(1800)
def test_a_run_whose_parent_is_killed_at_every_stage_ends_with_the_same_dataset(
    generated, tree_hashes, tmp_path
) -> None:
    root = tmp_path / generated.name
    partial = root.with_name(root.name + ".partial")
    command = [
        *(sys.executable, "-m", "lerobot_bimanual.cli", "generate", f"--root={root}", "--workers=2"),
        *("--task=lift_ball", "--episodes=3", "--image_size=24x32", "--cameras=front,left_wrist"),
        *("--intermediate=0.5", "--episodes_per_shard=2", "--repo_id=local/small"),
    ]
    place = Path(tempfile.mkdtemp(dir="/tmp"))  # short enough for the path of a socket
    environment = os.environ | {"TMPDIR": str(place)}
    rng = np.random.default_rng()  # at other moments in every run of the test
    for sight, latest_s in KILL_WHEN.items():
        run = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True, env=environment)
        while not any(partial.glob(sight)):
            assert run.poll() is None, f"ended before {sight} appeared"
            time.sleep(0.01)
        time.sleep(rng.uniform(0, latest_s))
        os.kill(run.pid, signal.SIGKILL)  # the parent alone: its workers have to notice
        run.wait()
        wait_until_gone(run.pid)
        assert not root.exists()
    last = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert last.returncode == 0, last.stderr
    assert "leaked" not in last.stderr
    assert not list(place.glob("lerobot_bimanual-*"))
    shutil.rmtree(place)
    assert not partial.exists()
    assert tree_hashes(root) == tree_hashes(generated)


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("victim", ["parent", "all"])
def test_runs_killed_at_random_moments_lose_only_what_was_unfinished_and_leave_nothing(
    tmp_path, victim
) -> None:
    words = [sys.executable, str(DRILL), str(tmp_path), str(KILLS), str(SEED), victim]
    drill = subprocess.run(words, capture_output=True, text=True, check=False)
    assert drill.returncode == 0, drill.stdout + drill.stderr
    outcome = json.loads(drill.stdout.splitlines()[-1])
    assert outcome["kills"] == KILLS
    assert outcome["redone"] == []
    assert outcome["damaged"] == []
    assert outcome["datasets"] >= 1
    assert outcome["different"] == 0
    assert outcome["leftovers"] == []


def wait_until_gone(group: int, patience_s: float = 20) -> None:
    deadline = time.monotonic() + patience_s
    while any(group_of(entry.name) == group for entry in Path("/proc").iterdir()):
        assert time.monotonic() < deadline, "workers outlived their parent"
        time.sleep(0.1)


def group_of(process: str) -> int | None:
    try:
        return os.getpgid(int(process))
    except (ValueError, ProcessLookupError):
        return None
