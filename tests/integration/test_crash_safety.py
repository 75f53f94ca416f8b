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

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.sim]

DEATHS = (("record", "tmp-*/frames", 0.5), ("record", "shards/000000", 0.2), ("merge", "tmp-*/dataset", 0.1))
"""(stage, sight, latest_s) of dying_generate.py: while the first shard is recorded, after it, and while shards are
merged."""

DYING = Path(__file__).with_name("dying_generate.py")
DRILL = Path(__file__).with_name("crash_drill.py")
KILLS = 8
SEED = 20


@pytest.mark.timeout(1800)
def test_a_run_whose_parent_is_killed_at_every_stage_ends_with_the_same_dataset(
    generated, tree_hashes, tmp_path
) -> None:
    root = tmp_path / generated.name
    partial = root.with_name(root.name + ".partial")
    flags = [
        *(f"--root={root}", "--workers=2", "--task=lift_ball", "--episodes=3", "--image_size=24x32"),
        *("--cameras=front,left_wrist", "--intermediate=0.5", "--episodes_per_shard=2"),
        "--repo_id=local/small",
    ]
    place = Path(tempfile.mkdtemp(dir="/tmp"))  # short enough for the path of a socket
    environment = os.environ | {"TMPDIR": str(place)}
    for stage, sight, latest_s in DEATHS:
        command = [sys.executable, str(DYING), stage, sight, str(latest_s), *flags]
        run = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True, env=environment)
        assert run.wait() == -signal.SIGKILL  # the parent alone: its workers have to notice
        wait_until_gone(run.pid)
        assert not root.exists()
    command = [sys.executable, "-m", "lerobot_bimanual.cli", "dataset", "generate", *flags]
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
