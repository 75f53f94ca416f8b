"""Files are on the disk before they are renamed; cores and memory for a process; signals that end it."""

import fcntl
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lerobot_bimanual import resources
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import (
    UnwritableOutput,
    locked,
    move_durably,
    read_yaml,
    share_files,
    write_file,
)
from lerobot_bimanual.interrupts import end_when_parent_ends, termination_as_system_exit

KILLED_WHILE_WRITING = """
import os, sys
from pathlib import Path
from lerobot_bimanual import files
files.move_durably = lambda *_: os.kill(os.getpid(), 9)
files.write_file(Path(sys.argv[1]), "cut")
"""


@pytest.fixture
def steps(monkeypatch) -> list[tuple[str, str]]:
    """What is brought to the disk and renamed, in this order."""
    done: list[tuple[str, str]] = []
    fsync, replace = os.fsync, Path.replace

    def note_sync(descriptor: int) -> None:
        done.append(("sync", Path(f"/proc/self/fd/{descriptor}").readlink().name))
        fsync(descriptor)

    def note_rename(path: Path, target: Path) -> Path:
        done.append(("rename", target.name))
        return replace(path, target)

    monkeypatch.setattr(os, "fsync", note_sync)
    monkeypatch.setattr(Path, "replace", note_rename)
    return done


def test_a_folder_is_synced_to_the_disk_before_it_is_renamed_and_its_new_parent_afterwards(tmp_path, steps):
    (tmp_path / "new/deep").mkdir(parents=True)
    (tmp_path / "new/a").write_text("a")
    (tmp_path / "new/deep/b").write_text("b")
    (tmp_path / "places").mkdir()
    move_durably(tmp_path / "new", tmp_path / "places/final")
    assert set(steps[:4]) == {("sync", name) for name in ("a", "b", "deep", "new")}
    assert steps[4:] == [("rename", "final"), ("sync", "places")]
    assert (tmp_path / "places/final/deep/b").read_text() == "b"


def test_the_next_write_removes_the_partial_file_of_a_killed_process_and_no_other_file(tmp_path) -> None:
    child = subprocess.Popen([sys.executable, "-c", KILLED_WHILE_WRITING, str(tmp_path / "a[1].json")])
    assert child.wait() == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    of_another_process = left.with_name(left.name.replace(str(child.pid), str(os.getppid())))
    others = [of_another_process, tmp_path / ".b.json.1.partial"]
    for other in others:
        other.touch()
    write_file(tmp_path / "a[1].json", "new")
    assert {*tmp_path.iterdir()} == {tmp_path / "a[1].json", *others}


def test_a_file_name_that_is_too_long_is_a_clear_error(tmp_path) -> None:
    with pytest.raises(UnwritableOutput, match="File name too long; choose another place"):
        write_file(tmp_path / ("a" * 250), "")


def test_a_folder_is_locked_by_a_writable_file_since_network_file_systems_lock_nothing_else(
    tmp_path, monkeypatch
):
    modes = []

    def note(descriptor: int, _: int) -> None:
        modes.append((os.fstat(descriptor).st_mode, fcntl.fcntl(descriptor, fcntl.F_GETFL)))

    monkeypatch.setattr(fcntl, "flock", note)
    with locked(tmp_path / "a"):
        assert {path.name for path in tmp_path.iterdir()} == {"a", ".a.lock"}
    assert {path.name for path in tmp_path.iterdir()} == {"a"}
    ((mode, flags),) = modes
    assert stat.S_ISREG(mode)
    assert flags & os.O_RDWR


def test_a_lock_that_its_owner_has_just_removed_locks_nothing(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(fcntl, "flock", lambda *_: (tmp_path / ".a.lock").unlink())
    with pytest.raises(BimanualError, match="by another process; wait for it"), locked(tmp_path / "a"):
        pass


def test_files_of_another_user_are_left_as_they_are(tmp_path, monkeypatch) -> None:
    (tmp_path / "a.safetensors").touch(0o600)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    share_files(tmp_path, "*.safetensors")
    assert (tmp_path / "a.safetensors").stat().st_mode & 0o777 == 0o600


def test_files_are_shared_as_the_umask_says(tmp_path) -> None:
    own, other = tmp_path / "step" / "a.safetensors", tmp_path / "b.json"
    own.parent.mkdir()
    for path in (own, other):
        path.touch(0o600)
    before = os.umask(0o027)
    try:
        share_files(tmp_path, "*.safetensors")
    finally:
        os.umask(before)
    assert [path.stat().st_mode & 0o777 for path in (own, other)] == [0o640, 0o600]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("a: &a [x, x]\nb: &b [*a, *a]\ntype: [*b, *b]", "has an alias"),
        ("[" * 10_000 + "]" * 10_000, "recursion"),
        (" " * (2**16 + 1), "exceeds the limit"),
        ("!!python/object/apply:os.getpid []", "constructor"),
    ],
)
def test_a_yaml_file_with_aliases_deep_nesting_too_much_text_or_code_is_refused(content, said, tmp_path):
    (tmp_path / "config.yaml").write_text(content)
    with pytest.raises(BimanualError, match=f"config.yaml: .*{said}") as error:
        read_yaml(tmp_path / "config.yaml")
    assert str(error.value).isprintable()


V2 = {"job/cpu.max": "150000 100000", "job/memory.max": "3000", "job/memory.current": "2500"}
V1 = {"cpu/cpu.cfs_quota_us": "150000", "cpu/cpu.cfs_period_us": "100000"}
V1 |= {"memory/memory.limit_in_bytes": "3000", "memory/memory.usage_in_bytes": "2500"}
V1 |= {"memory/memory.stat": "cache 900\ntotal_inactive_file 500\n"}
FREE = {"cpu.max": "max 100000", "cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}
FREE |= {"memory.max": "max"}


@pytest.mark.parametrize(
    ("path", "files", "cores", "memory"),
    [
        ("0::/job/step_0/task_0", V2 | {"job/step_0/cpu.max": "max 100000"}, 2, 500),
        ("0::/job", V2 | {"job/memory.stat": "file 700\ninactive_file 400"}, 2, 900),
        ("5:cpu,cpuacct:/docker/of/the/host\n4:memory:/docker/of/the/host", V1, 2, 1000),
        ("0::/\n5:cpu,cpuacct:/\n4:memory:/", FREE, 4, 7 * 1024),
        ("", {}, 4, 7 * 1024),
    ],
)
def test_cores_and_memory_are_within_affinity_and_groups(path, files, cores, memory, tmp_path, monkeypatch):
    monkeypatch.setattr(resources.os, "sched_getaffinity", lambda _: range(4))
    monkeypatch.setattr(resources, "PROCESS", tmp_path / "cgroup")
    monkeypatch.setattr(resources, "GROUPS", tmp_path)
    monkeypatch.setattr(resources, "MEMORY", tmp_path / "meminfo")
    for name, text in (files | {"cgroup": path, "meminfo": "MemTotal: 9 kB\nMemAvailable: 7 kB\n"}).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert (resources.usable_cores(), resources.usable_memory()) == (cores, memory)
    assert (resources.worker_count(0), resources.worker_count(9)) == (1, 9)  # there is memory for none


class Finalized:
    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0)  # so that the signal is answered here


def is_swallowed() -> None:
    Finalized()
    time.sleep(20)


def becomes_another_error() -> None:
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(20)
    except SystemExit as end:
        raise TypeError("incompatible function arguments") from end


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.timeout(30, method="thread")  # the alarm is in use
@pytest.mark.parametrize("termination", [is_swallowed, becomes_another_error])
def test_a_process_ends_on_sigterm_even_if_its_exception_is_swallowed_or_replaced(termination):
    with pytest.raises(SystemExit) as exit_, termination_as_system_exit():
        termination()
    assert exit_.value.code == 128 + signal.SIGTERM


def test_a_process_whose_parent_is_gone_before_it_could_ask_ends_itself():
    code = f"import os, signal; from {end_when_parent_ends.__module__} import end_when_parent_ends as end; end(signal.SIGTERM, {os.getpid() + 1})"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGTERM
