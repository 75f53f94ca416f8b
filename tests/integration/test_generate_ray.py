"""Ray records the same dataset, also when a worker dies on the way."""

import os
import signal
import sys
import threading
from pathlib import Path

import pytest

from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.commands.dataset_generate import dataset_generate

TASK_TITLE = b"ray::record_packed"
"""How ray names the process of a running task."""


class Killer(threading.Thread):
    """Kills the first process of this test's cluster that it sees busy with a shard."""

    def __init__(self):
        super().__init__(daemon=True)
        self.killed: int | None = None
        self.has_ended = threading.Event()

    def run(self) -> None:
        while not self.has_ended.wait(0.2):
            for entry in Path("/proc").glob("[0-9]*"):
                if records_something(entry):
                    self.killed = int(entry.name)
                    os.kill(self.killed, signal.SIGKILL)
                    return


def records_something(process: Path) -> bool:
    """Whether a process of this test is in the middle of a shard: it runs the task and has an episode's file open."""
    try:
        if not (process / "cmdline").read_bytes().startswith(TASK_TITLE):
            return False
        if parent_of(parent_of(process)).name != str(os.getpid()):  # this test started its raylet
            return False
        return any("tmp-" in str(file.readlink()) for file in (process / "fd").iterdir())
    except OSError:  # gone meanwhile
        return False


def parent_of(process: Path) -> Path:
    fields_after_name = (process / "stat").read_text().rpartition(")")[2].split()
    return process.with_name(fields_after_name[1])


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.timeout(900)
def test_two_machines_and_a_killed_worker_give_the_dataset_of_one_process(
    generated, small_generation, tree_hashes, tmp_path, monkeypatch
) -> None:
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_worker_niceness", "0")  # by default everything else on the machine goes first
    killer = Killer()
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        cluster.add_node(num_cpus=1)
        killer.start()
        root = tmp_path / generated.name
        dataset_generate(small_generation(root, executor="ray", ray_address=cluster.address, workers=0))
    finally:
        killer.has_ended.set()
        cluster.shutdown()
    assert killer.killed is not None, "no worker was killed"
    assert tree_hashes(root) == tree_hashes(generated)
    assert [path.name for path in tmp_path.iterdir()] == [root.name]


def test_without_ray_the_error_names_the_extra(small_generation, tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.delitem(sys.modules, "lerobot_env_bimanual.generation.ray_cluster", raising=False)
    with pytest.raises(DatasetError, match=r"pip install 'lerobot_bimanual\[ray\]'"):
        dataset_generate(small_generation(tmp_path / "never", executor="ray"))


def test_a_cluster_that_is_not_there_is_one_clear_error(small_generation, tmp_path, monkeypatch) -> None:
    def init(address: str, **_) -> None:
        raise ConnectionError("nobody answers")  # what ray says after minutes

    monkeypatch.setattr("ray.init", init)
    with pytest.raises(DatasetError, match=r"cannot reach a ray cluster at 127\.0\.0\.1:1: nobody answers"):
        dataset_generate(small_generation(tmp_path / "never", executor="ray", ray_address="127.0.0.1:1"))
