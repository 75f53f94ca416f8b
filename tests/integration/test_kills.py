"""Whoever uses worker processes may be killed: nothing of it is left a few seconds later."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytestmark = [pytest.mark.slow, pytest.mark.sim]

PATIENCE_S = 10.0
"""Within which orphans have to be gone; they take tenths of a second."""

COMMANDS = {
    "expert evaluate": "--task=lift_ball --seeds=0:1000",
    "dataset generate": "--task=lift_ball --episodes=1000 --image_size=32 --root={folder}/data",
    "dataset verify": "--root={dataset}",
    "dataset replay": "--root={dataset}",
    "task render": "--task=lift_ball,push_box --output={folder}/pictures",
}

LATEST_S = {"dataset verify": 0.3, "dataset replay": 0.3}
"""How long at most they are let work before they are killed: three episodes take a second. Others have no end: 2 s."""

ATTEMPTS = 10
"""To kill one before it ends by itself, which on a busy machine it may do first."""

VECTOR_ENVIRONMENT = textwrap.dedent("""
    from functools import partial
    import numpy as np
    from lerobot_env_bimanual.env import BimanualEnv
    from lerobot_env_bimanual.vector import LazyVectorEnv
    envs = LazyVectorEnv([partial(BimanualEnv, "lift_ball", obs="state")] * 2, asynchronous=True)
    while True:
        envs.reset(seed=0)
        envs.step(np.stack([observation["agent_pos"] for observation in envs.call("observe")]))
""")


def commands(dataset: Path, folder: Path) -> dict[str, list[str]]:
    ours = {
        command: ["-m", "lerobot_bimanual.cli", *command.split(), "--workers=2", *flags.split()]
        for command, flags in COMMANDS.items()
    }
    words = {**ours, "vector environment": ["-c", VECTOR_ENVIRONMENT]}
    return {
        user: [
            sys.executable,
            *(word.format(dataset=dataset, folder=folder) if user in COMMANDS else word for word in line),
        ]
        for user, line in words.items()
    }


@pytest.mark.parametrize("user", [*COMMANDS, "vector environment"])
def test_nothing_is_left_of_a_killed_user_of_workers(user, generated, tmp_path):
    rng = np.random.default_rng()  # at another moment in every run of the test
    for _ in range(ATTEMPTS):
        parent = subprocess.Popen(
            commands(generated, tmp_path)[user],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            cwd=tmp_path,
        )
        deadline = time.monotonic() + 120
        # Itself, resource tracker, fork server, a worker.
        while parent.poll() is None and len(processes_of(parent.pid)) < 4:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        time.sleep(rng.uniform(0, LATEST_S.get(user, 2)))
        semaphores = set(semaphores_of(parent.pid))
        parent.kill()
        if parent.wait() == -signal.SIGKILL:
            break
    else:
        pytest.fail(f"ended before it was killed, {ATTEMPTS} times")
    deadline = time.monotonic() + PATIENCE_S
    while left := processes_of(parent.pid):
        assert time.monotonic() < deadline, f"left over: {left}"
        time.sleep(0.1)
    assert not [path for path in semaphores if path.exists()]


INTERRUPTED = {
    "expert evaluate": "--task=lift_ball --seeds=0:6 --output={folder}/{run}.json",
    "dataset generate": "--task=lift_ball --episodes=3 --episodes_per_shard=1 --image_size=24 --view=keyframes "
    "--root={folder}/{run}/data",
    "dataset verify": "--root={dataset}",
    "dataset replay": "--root={dataset}",
}


@pytest.mark.parametrize("command", INTERRUPTED)
def test_a_killed_worker_changes_no_result(command, generated, tree_hashes, tmp_path):
    outputs = []
    for run in ("undisturbed", "disturbed"):
        flags = INTERRUPTED[command].format(dataset=generated, folder=tmp_path, run=run).split()
        parent = subprocess.Popen(
            [sys.executable, "-m", "lerobot_bimanual.cli", *command.split(), "--workers=2", *flags],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        if run == "disturbed":
            while not (workers := workers_of(parent.pid)):
                assert parent.poll() is None, "ended before it had workers"
                time.sleep(0.02)
            os.kill(workers[0], signal.SIGKILL)
        output, errors = parent.communicate(timeout=300)
        assert parent.returncode == 0, output + errors
        outputs.append(output.replace(run, "RUN"))
    if command != "dataset generate":  # which says how long it took
        assert outputs[0] == outputs[1]
    if command == "expert evaluate":
        assert (tmp_path / "undisturbed.json").read_bytes() == (tmp_path / "disturbed.json").read_bytes()
    if command == "dataset generate":
        assert tree_hashes(tmp_path / "undisturbed") == tree_hashes(tmp_path / "disturbed")


def workers_of(parent: int) -> list[int]:
    """Processes forked from the fork server of a session's first process, which are grandchildren."""
    found = []
    for process in processes_of(parent):
        with contextlib.suppress(OSError, IndexError):
            grandparent = parent_of(parent_of(int(process.name)))
            if grandparent == parent:
                found.append(int(process.name))
    return found


def parent_of(process: int) -> int:
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])


def processes_of(session: int) -> list[Path]:
    """Folders in /proc of the processes of a session."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(ProcessLookupError):
            if os.getsid(int(entry.name)) == session:
                found.append(entry)
    return found


def semaphores_of(session: int) -> Iterator[Path]:
    """Files of the named semaphores that processes of a session use."""
    for process in processes_of(session):
        with contextlib.suppress(OSError):
            yield from map(Path, re.findall(r"/dev/shm/sem\.\S+", (process / "maps").read_text()))
