"""Cores and memory that this process may use; in a container or a job they are fewer than the machine has."""

import math
import os
from collections.abc import Iterator
from pathlib import Path

PROCESS, GROUPS = Path("/proc/self/cgroup"), Path("/sys/fs/cgroup")
MEMORY = Path("/proc/meminfo")
MEMORY_FILES = (
    ("memory.max", "memory.current", "inactive_file"),
    ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
)
"""For cgroups v2 and v1: limit, usage, and the part of the usage that is file cache, which the system drops first."""
WORKER_BYTES = 9 * 10**8
"""Memory of a process that simulates and draws: 0.76 to 0.96 GB were measured."""


def usable_cores() -> int:
    """Cores that this process may use: those it is bound to, within the quota of its cgroups (rounded up)."""
    cores: list[float] = [len(os.sched_getaffinity(0))]
    for group in _groups("cpu"):
        quota = _words(group, "cpu.max") or _words(group, "cpu.cfs_quota_us", "cpu.cfs_period_us")
        if len(quota) == 2 and quota[0] not in ("max", "-1"):
            cores.append(int(quota[0]) / int(quota[1]))
    return max(1, math.ceil(min(cores)))


def usable_memory() -> int:
    """Bytes that this process may still take: what is free, within the limits of its cgroups."""
    free = [1024 * _entry(MEMORY, "MemAvailable:")]
    for group in _groups("memory"):
        for limit, usage, dropped in MEMORY_FILES:
            used = _words(group, limit, usage)
            if len(used) == 2 and used[0] != "max":
                free.append(int(used[0]) - int(used[1]) + _entry(group / "memory.stat", dropped))
    return max(0, min(free))


def worker_count(asked: int) -> int:
    """Worker processes: as many as requested; for 0 one per usable core, if the memory is enough for so many."""
    return asked or max(1, min(usable_cores(), usable_memory() // WORKER_BYTES))


def _groups(controller: str) -> Iterator[Path]:
    """Folders of this process's cgroups and of those above, of v2 and v1; any of them may hold a limit.

    A container may be told its path on the host and yet have its own group at the top, so not all of them exist.
    """
    for line in PROCESS.read_text().splitlines() if PROCESS.is_file() else ():
        _, controllers, path = line.split(":", 2)
        if not controllers or controller in controllers.split(","):
            below, top = Path(path.lstrip("/")), GROUPS / (controller if controllers else "")
            yield from (top / part for part in (below, *below.parents))


def _words(folder: Path, *names: str) -> list[str]:
    """The words of files; none where one of them cannot be read."""
    try:
        return " ".join((folder / name).read_text() for name in names).split()
    except OSError:
        return []


def _entry(file: Path, key: str) -> int:
    """The number behind a key in a file; 0 where there is none."""
    words = _words(file.parent, file.name)
    return int(words[words.index(key) + 1]) if key in words else 0
