"""Worker processes answer in order, fail in words, and do not outlive their parent."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lerobot_bimanual.errors import UnknownTask
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.workers import WorkerDied, WorkerPool

FOREVER_S = 100_000

BUSY = f"""
import time
from lerobot_env_bimanual.workers import WorkerPool
with WorkerPool(2) as pool:
    for _ in pool.run(time.sleep, [0, {FOREVER_S}, {FOREVER_S}], poll_s=0.1):
        print("running", flush=True)
"""


def test_results_come_in_order_from_workers_of_one_thread_each(capsys) -> None:
    with WorkerPool(2) as pool:
        assert list(pool.map(int, ["3", "1", "2"], "reading", "number")) == [3, 1, 2]
        assert list(pool.map(os.getenv, ["OMP_NUM_THREADS"], "reading", "number", done=3)) == ["1"]
    bar = capsys.readouterr().err
    assert "reading: 100%" in bar
    assert "4/4" in bar


def test_an_error_comes_home_as_it_was_raised() -> None:
    with pytest.raises(UnknownTask, match="unknown task 'wash_dishes'"), WorkerPool(1) as pool:
        list(pool.map(get_task, ["wash_dishes"], "looking", "task"))


def test_the_death_of_a_worker_is_one_clear_error() -> None:
    for use in (
        lambda pool: list(pool.map(os._exit, [1], "dying", "worker")),
        lambda pool: list(pool.run(os._exit, [1], poll_s=0.1)),
    ):
        with pytest.raises(WorkerDied, match="repeat the command, perhaps with fewer --workers"):  # noqa: SIM117
            with WorkerPool(1) as pool:
                use(pool)


def test_an_interrupted_pool_waits_for_nobody() -> None:
    with pytest.raises(KeyboardInterrupt), WorkerPool(1) as pool:  # noqa: PT012
        for _ in pool.run(time.sleep, [FOREVER_S], poll_s=0.1):
            raise KeyboardInterrupt


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_workers_end_with_their_parent_however_that_ends(end: signal.Signals) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", BUSY],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    assert parent.stdout is not None
    parent.stdout.readline()
    os.kill(parent.pid, end)
    parent.wait()
    while processes_of(parent.pid):
        time.sleep(0.1)


def processes_of(session: int) -> list[str]:
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if os.getsid(int(entry.name)) == session:
                found.append(entry.name)
        except ProcessLookupError:
            continue
    return found
