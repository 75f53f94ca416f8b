"""The worker processes of this machine, with LeRobot imported once for all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path

from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.generation.executor import POLL_S, MergeJob
from lerobot_env_bimanual.generation.plan import Shard
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import plain_write_errors
from lerobot_env_bimanual.worker import WorkFailed
from lerobot_env_bimanual.workers import WorkerPool, worker_context

PRELOADED = ("lerobot_bimanual.dataset.writer",)
"""Seven seconds of LeRobot and torch."""

LOCK_PATIENCE_S = 1.0
"""For a lock that is held for microseconds."""


@dataclass(frozen=True)
class _Tally:
    """What all workers count together.

    Attributes:
        successes: episodes recorded.
        cpu_seconds: CPU time of finished work.
    """

    successes: Synchronized[int]
    cpu_seconds: Synchronized[float]


class ProcessExecutor(WorkerPool):
    """A pool of processes on this machine; an `Executor`.

    Args:
        workers: number of processes; 0 takes one per core.
    """

    def __init__(self, workers: int):
        context = worker_context()
        self._tally = _Tally(context.Value("q", 0), context.Value("d", 0.0))
        super().__init__(workers, _prepare, (self._tally,), PRELOADED)

    @property
    def successes(self) -> int:
        """Episodes recorded so far; read without the lock, which a killed worker may have taken along."""
        return self._tally.successes.get_obj().value

    @property
    def cpu_seconds(self) -> float:
        """See `Executor`; read without the lock, too."""
        return self._tally.cpu_seconds.get_obj().value

    def record(
        self, settings: GenerationSettings, shards: Sequence[Shard], folder: Callable[[str], Path]
    ) -> Iterator[None]:
        """See `Executor`."""
        with _finished_shards_kept():
            work = [(settings, shard, folder(shard.name)) for shard in shards]
            yield from self.run(_record, work, POLL_S, lambda item: f"shard {item[1].name}")

    def merge(self, jobs: Sequence[MergeJob]) -> Iterator[None]:
        """See `Executor`."""
        with _finished_shards_kept():
            yield from self.run(_merge, jobs, POLL_S, lambda job: f"merging view {job.view!r}")


@contextmanager
def _finished_shards_kept() -> Iterator[None]:
    try:
        yield
    except WorkFailed as error:
        raise DatasetError(f"{error}. Finished shards are kept") from error


class _Worker:
    """What a worker process keeps from one work to the next.

    Args:
        tally: of its parent.
    """

    def __init__(self, tally: _Tally):
        from lerobot_env_bimanual.generation.shard import ShardRecorder, quieten_libraries

        quieten_libraries()
        self.shards = ShardRecorder()
        self._tally = tally

    def count_success(self) -> None:
        _add(self._tally.successes, 1)

    @contextmanager
    def cpu_time_counted(self) -> Iterator[None]:
        start_s = time.process_time()
        yield
        _add(self._tally.cpu_seconds, time.process_time() - start_s)


def _add(counter: Synchronized, amount: float) -> None:
    """Count something that is only shown; given up if another worker died with the lock in its hand."""
    lock = counter.get_lock()
    if lock.acquire(timeout=LOCK_PATIENCE_S):
        try:
            counter.value += amount
        finally:
            lock.release()


_worker: _Worker | None = None


def _prepare(tally: _Tally) -> None:
    global _worker
    _worker = _Worker(tally)


def _record(work: tuple[GenerationSettings, Shard, Path]) -> None:
    assert _worker is not None
    with _worker.cpu_time_counted():
        _worker.shards.record(*work, _worker.count_success)


def _merge(job: MergeJob) -> None:
    from lerobot_env_bimanual.generation.merge import merge_shards

    assert _worker is not None
    with _worker.cpu_time_counted(), plain_write_errors(job.root):
        merge_shards(job)
