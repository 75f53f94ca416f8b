"""Cores and memory are those that a process may use, in containers and jobs, too."""

import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

import lerobot_bimanual
from lerobot_bimanual import resources

V2 = {"job/cpu.max": "150000 100000", "job/memory.max": "3000", "job/memory.current": "2500"}
V1 = {
    "cpu/cpu.cfs_quota_us": "150000",
    "cpu/cpu.cfs_period_us": "100000",
    "memory/memory.limit_in_bytes": "3000",
    "memory/memory.usage_in_bytes": "2500",
    "memory/memory.stat": "cache 900\ntotal_inactive_file 500\n",
}
FREE = {
    "cpu.max": "max 100000",
    "cpu/cpu.cfs_quota_us": "-1",
    "cpu/cpu.cfs_period_us": "100000",
    "memory.max": "max",
}


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
def test_cores_and_memory_are_within_affinity_and_control_groups(
    path, files, cores, memory, tmp_path, monkeypatch
):
    monkeypatch.setattr(resources.os, "sched_getaffinity", lambda _: range(4))
    monkeypatch.setattr(resources, "PROCESS", tmp_path / "cgroup")
    monkeypatch.setattr(resources, "GROUPS", tmp_path)
    monkeypatch.setattr(resources, "MEMORY", tmp_path / "meminfo")
    for name, text in (files | {"cgroup": path, "meminfo": "MemTotal: 9 kB\nMemAvailable: 7 kB\n"}).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert (resources.usable_cores(), resources.usable_memory()) == (cores, memory)
    assert (resources.worker_count(0), resources.worker_count(9)) == (1, 9)  # there is memory for none


def test_small_shared_memory_is_said_with_the_way_out(tmp_path, monkeypatch):
    monkeypatch.setattr(resources, "SHARED_MEMORY", tmp_path)
    for free, complaint in ((64 * 10**6, "has 64 MB, too few .*--shm-size.*--num_workers=0"), (2**31, "^$")):
        monkeypatch.setattr(shutil, "disk_usage", lambda _, free=free: SimpleNamespace(free=free))
        assert re.search(complaint, resources.shared_memory_problem())


def test_nothing_else_asks_the_system_for_cores_or_memory():
    asks = re.compile(
        r"\b(os\.cpu_count|process_cpu_count|cpu_count\(\)|virtual_memory|sched_getaffinity|SC_PHYS_PAGES)"
    )
    root = Path(lerobot_bimanual.__file__).parents[1]
    sources = [
        path
        for folder in ("lerobot_bimanual", "envs", "policies", "robots", "benchmarks")
        for path in (root / folder).rglob("*.py")
    ]
    assert [path.name for path in sources if asks.search(path.read_text())] == ["resources.py"]
