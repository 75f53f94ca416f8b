"""The worker processes of this machine, with LeRobot imported once for all of them."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.generation.executor import MergeJob
from lerobot_env_bimanual.generation.plan import Shard
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.generation.staging import plain_write_errors
from lerobot_env_bimanual.workers import START_METHOD, WorkerPool, WorkFailed

PRELOADED = ("lerobot_bimanual.dataset.writer",)
"""Seven seconds of LeRobot and torch."""


@dataclass(frozen=True)
class _News:
    """What a worker tells while it works, or has just done.

    Attributes:
        successes: episodes recorded.
        cpu_seconds: CPU time taken.
    """

    successes: int = 0
    cpu_seconds: float = 0.0


class ProcessExecutor(WorkerPool):
    """A pool of processes on this machine; an `Executor`.

    Args:
        workers: number of processes; 0 takes one per core.
    """

    def __init__(self, workers: int):
        # Not counters in shared memory: their locks outlive processes that are killed. A message is far below 4 kB, so
        # it arrives whole or not at all.
        self._news, self._outlet = multiprocessing.get_context(START_METHOD).Pipe(duplex=False)
        self._sum = _News()
        super().__init__(workers, _prepare, (self._outlet,), PRELOADED)

    @property
    def successes(self) -> int:
        """Episodes recorded so far."""
        return self._heard().successes

    @property
    def cpu_seconds(self) -> float:
        """See `Executor`."""
        return self._heard().cpu_seconds

    def _heard(self) -> _News:
        while self._news.poll():
            news = self._news.recv()
            self._sum = _News(self._sum.successes + news.successes, self._sum.cpu_seconds + news.cpu_seconds)
        return self._sum

    def record(
        self, settings: GenerationSettings, shards: Sequence[Shard], folder: Callable[[str], Path]
    ) -> Iterator[None]:
        """See `Executor`."""
        with _finished_shards_kept():
            work = [(settings, shard, folder(shard.name)) for shard in shards]
            yield from self.map(_record, work, "", "", name=lambda item: f"shard {item[1].name}", bar=False)

    def merge(self, jobs: Sequence[MergeJob]) -> Iterator[None]:
        """See `Executor`."""
        with _finished_shards_kept():
            yield from self.map(
                _merge, jobs, "", "", name=lambda job: f"merging view {job.view!r}", bar=False
            )


@contextmanager
def _finished_shards_kept() -> Iterator[None]:
    try:
        yield
    except WorkFailed as error:
        raise DatasetError(f"{error}. Finished shards are kept") from error


class _Worker:
    """What a worker process keeps from one work to the next.

    Args:
        outlet: where its parent hears of it.
    """

    def __init__(self, outlet: Connection):
        from lerobot_env_bimanual.generation.shard import ShardRecorder, quieten_libraries

        quieten_libraries()
        self.shards = ShardRecorder()
        self._outlet = outlet

    def tell_success(self) -> None:
        self._outlet.send(_News(successes=1))

    @contextmanager
    def cpu_time_told(self) -> Iterator[None]:
        start_s = time.process_time()
        yield
        self._outlet.send(_News(cpu_seconds=time.process_time() - start_s))


_worker: _Worker | None = None


def _prepare(outlet: Connection) -> None:
    global _worker
    _worker = _Worker(outlet)


def _record(work: tuple[GenerationSettings, Shard, Path]) -> None:
    assert _worker is not None
    with _worker.cpu_time_told():
        _worker.shards.record(*work, _worker.tell_success)


def _merge(job: MergeJob) -> None:
    from lerobot_env_bimanual.generation.merge import merge_shards

    assert _worker is not None
    with _worker.cpu_time_told(), plain_write_errors(job.root):
        merge_shards(job)
