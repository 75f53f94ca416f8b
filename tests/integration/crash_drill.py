"""Generates small datasets while killing the run at random moments; run by test_crash_safety.py, or by hand.

    python crash_drill.py FOLDER KILLS SEED VICTIM

VICTIM is `parent`, the process of the command, whose workers have to notice by themselves, or `all` of its processes
at once, after which nobody is left to tidy up. LeRobot is loaded once, here, and every run is a fork, so that the kills
hit the work and not the imports. Prints what was seen as one line of JSON.
"""

import contextlib
import json
import multiprocessing
import os
import select
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from lerobot_env_bimanual import workers
from lerobot_env_bimanual.commands.dataset_generate import DatasetGenerateConfig, dataset_generate
from lerobot_env_bimanual.generation import merge, shard  # noqa: F401  what a worker would import

SHARDS = 2
SEMAPHORES = f"drill-{os.getpid()}"
PATIENCE_S = 60
"""For workers whose parent was killed."""


def main(folder: Path, kills: int, seed: int, victim: str) -> dict[str, object]:
    """Kill runs until there were enough kills, and compare every dataset that was finished."""
    workers.START_METHOD = "fork"
    (folder / "tmp").mkdir()
    tempfile.tempdir = str(folder / "tmp")
    # What semaphores are named after, here and in forks, so that those of other programs are not taken for ours.
    multiprocessing.current_process()._config["semprefix"] = f"/{SEMAPHORES}"  # pyright: ignore[reportAttributeAccessIssue]
    undisturbed = folder / "undisturbed" / "drill"
    start = time.monotonic()
    assert run(undisturbed) is None
    duration_s = time.monotonic() - start
    expected = contents(undisturbed)

    rng = np.random.default_rng(seed)
    root = folder / "killed" / "drill"
    partial = root.with_name(root.name + ".partial")
    seen = {"kills": 0, "datasets": 0, "different": 0, "redone": [], "damaged": [], "leftovers": []}
    finished: dict[str, int] = {}
    while seen["kills"] < kills or partial.exists():
        delay_s = rng.uniform(0, duration_s) if seen["kills"] < kills else None
        was_killed = run(root, victim, delay_s) is not None
        seen["kills"] += was_killed
        now = {path.parent.name: path.stat().st_mtime_ns for path in partial.glob("shards/*/SHA256SUMS")}
        if was_killed and not root.exists():  # while it is tidied up, shards disappear
            seen["redone"] += [name for name in finished if now.get(name) != finished[name]]
            finished = now
        if root.exists() and not partial.exists():
            seen["datasets"] += 1
            seen["different"] += contents(root) != expected
            shutil.rmtree(root)
            finished = {}
        (folder / "seen.json").write_text(json.dumps(seen))  # for whoever waits
    seen["damaged"] = [line for line in (folder / "log").read_text().splitlines() if "written again" in line]
    seen["damaged"] += [
        line for line in (folder / "log").read_text().splitlines() if "recorded again" in line
    ]
    left = (root.parent.iterdir(), (folder / "tmp").iterdir(), Path("/dev/shm").glob(f"sem.{SEMAPHORES}*"))
    seen["leftovers"] = [str(path) for paths in left for path in paths]
    return seen


def run(root: Path, victim: str = "all", kill_after_s: float | None = None) -> int | None:
    """Generate in a process group of its own; returns the signal that ended it, or `None`."""
    alive, held_by_the_group = os.pipe()
    process = os.fork()
    if process == 0:
        os.setsid()
        root.parent.mkdir(parents=True, exist_ok=True)
        log = os.open(root.parent.parent / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(log, 1)
        os.dup2(log, 2)
        dataset_generate(
            DatasetGenerateConfig(
                task="lift_ball",
                episodes=SHARDS,
                episodes_per_shard=1,
                image_size="24x32",
                cameras=("front",),
                workers=2,
                repo_id="local/drill",
                root=root,
            )
        )
        sys.exit()
    if kill_after_s is not None:
        time.sleep(kill_after_s)
        with contextlib.suppress(ProcessLookupError):  # it has not become a group yet
            (os.kill if victim == "parent" else os.killpg)(process, signal.SIGKILL)
    os.close(held_by_the_group)
    gone, _, _ = select.select([alive], [], [], PATIENCE_S if kill_after_s is not None else None)
    assert gone, "workers outlived their parent"  # the last process of the group closes its end
    os.close(alive)
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    assert status in (0, -signal.SIGKILL), (root.parent.parent / "log").read_text()
    return signal.SIGKILL if status else None


def contents(root: Path) -> dict[str, bytes]:
    """Every file of a folder."""
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


if __name__ == "__main__":
    json.dump(main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]), sys.stdout)
