"""Worker processes answer in order, fail in words, and do not outlive their parent."""

import os
import signal
import subprocess
import sys
import time

import pytest
import worker_jobs as jobs

from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.workers import WorkerPool, WorkFailed

FOREVER_S = 100_000

BUSY = f"""
import time
from lerobot_env_bimanual.workers import WorkerPool
with WorkerPool(2) as pool:
    for _ in pool.map(time.sleep, [0, {FOREVER_S}, {FOREVER_S}], "sleeping", "night"):
        print("running", flush=True)
"""
STARTING = BUSY.replace("WorkerPool(2)", "WorkerPool(2, preload=['slow'])")
SLOW = f"import time; print('importing', flush=True); time.sleep({FOREVER_S})"


def test_results_are_noted_as_they_arrive_and_returned_in_the_order_of_items(tmp_path) -> None:
    words = [str(tmp_path / "tried twice"), "quick", "too"]
    noted = []
    with WorkerPool(1) as pool:
        found = pool.map(jobs.double_or_die, words, "doubling", "word", note=lambda *pair: noted.append(pair))
        assert [*found] == [2 * word for word in words]
    assert noted == [(word, 2 * word) for word in [*words[1:], words[0]]]


@pytest.mark.parametrize("workers", [1, 3])
def test_a_dead_worker_loses_only_its_own_item_which_is_tried_again(workers):
    words = ["a", jobs.OBSTINATE, "b", "c"]
    with WorkerPool(workers) as pool:
        results = pool.map(jobs.double_or_die, words, "doubling", "word", failed=lambda _, reason: reason)
        one, lost, two, three = results
    assert (one, two, three) == ("aa", "bb", "cc")
    assert lost.startswith("its worker process died, also when it was tried alone")


def test_our_errors_are_raised_again_unchanged_and_all_others_with_a_description():
    for function, error, complaint in (
        (get_task, InvalidChoice, "task is '7'"),
        (jobs.raise_unportable, WorkFailed, r"7: unexpected Unportable: two numbers \(worker_jobs.py, line"),
        (jobs.misspell_a_prop, WorkFailed, r"7: unexpected KeyError: .*'bal'.* \(worker_jobs.py, line"),
        (jobs.result_without_a_pickle, WorkFailed, "7: unexpected .*pickle"),
    ):
        with pytest.raises(error, match=complaint) as raised, WorkerPool(1) as pool:
            list(pool.map(function, ["7"], "trying", "number"))
        assert raised.value.__notes__  # the traceback in the worker


def test_a_pool_can_be_used_again_after_its_work_was_left_unfinished():
    with WorkerPool(2) as pool:
        for _ in pool.map(time.sleep, [0, FOREVER_S, FOREVER_S], "sleeping", "night"):
            break
        assert list(pool.map(int, ["3", "1"], "reading", "number")) == [3, 1]


def test_a_system_that_cannot_start_workers_is_a_clear_error(tmp_path) -> None:
    (folder := tmp_path / (80 * "a")).mkdir()
    program = "import sys; from lerobot_env_bimanual.workers import WorkerPool; WorkerPool(1).map(int, ['1'], '', '')"
    child = subprocess.run(
        [sys.executable, "-c", f"{program}.__next__()"],
        env=os.environ | {"TMPDIR": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (
        "BimanualError: no worker process can be started: AF_UNIX path too long. They need a TMPDIR"
        in child.stderr
    )


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("program", [BUSY, STARTING])
def test_workers_end_with_their_parent_however_that_ends_and_leave_nothing(program, end, tmp_path):
    (tmp_path / "slow.py").write_text(SLOW)
    (tmp_path / "tmp").mkdir()
    parent = subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env=os.environ | {"TMPDIR": str(tmp_path / "tmp"), "PYTHONPATH": str(tmp_path)},
    )
    assert parent.stdout is not None
    parent.stdout.readline()
    os.kill(parent.pid, end)
    parent.wait()
    while jobs.processes_of(parent.pid):
        time.sleep(0.1)
    assert [*(tmp_path / "tmp").iterdir()] == []
