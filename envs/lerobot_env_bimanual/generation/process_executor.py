"""Worker processes: one per core, with LeRobot imported once for all of them, gone as soon as their parent is."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from types import TracebackType
from typing import Self

from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.generation import worker
from lerobot_env_bimanual.generation.candidates import Shard
from lerobot_env_bimanual.generation.executor import POLL_S, MergeJob
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.workers import prepare_worker, use_one_thread_per_process

START_METHOD = "forkserver"
PRELOADED = ("lerobot_bimanual.dataset.writer",)
"""Imported once, in the process that workers are forked from: seven seconds of LeRobot and torch. Not MuJoCo, as
an OpenGL driver does not survive a fork."""


@dataclass(frozen=True)
class _Tally:
    """What all workers count together.

    Attributes:
        successes: episodes recorded.
        cpu_seconds: CPU time of finished work.
    """

    successes: Synchronized[int]
    cpu_seconds: Synchronized[float]


class ProcessExecutor:
    """A pool of processes on this machine; an `Executor`.

    Args:
        workers: number of processes; 0 takes one per core.
    """

    def __init__(self, workers: int):
        use_one_thread_per_process()
        context = multiprocessing.get_context(START_METHOD)
        context.set_forkserver_preload([*PRELOADED])
        self._others = multiprocessing.active_children()
        self._tally = _Tally(context.Value("q", 0), context.Value("d", 0.0))
        self._pool = ProcessPoolExecutor(
            workers or os.cpu_count() or 1, context, _start_worker, (self._tally,)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Stop the processes; at once if the block failed, as what they have not finished is lost anyway."""
        if error is not None:
            for child in set(multiprocessing.active_children()) - set(self._others):
                child.terminate()
        self._pool.shutdown(cancel_futures=True)

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
        yield from self._watch(
            [self._pool.submit(_record, settings, shard, folder(shard.name)) for shard in shards]
        )

    def merge(self, jobs: Sequence[MergeJob]) -> Iterator[None]:
        """See `Executor`."""
        yield from self._watch([self._pool.submit(_merge, job) for job in jobs])

    def _watch(self, futures: Sequence[Future]) -> Iterator[None]:
        waiting = set(futures)
        while waiting:
            done, waiting = wait(waiting, timeout=POLL_S, return_when=FIRST_COMPLETED)
            try:
                for future in done:
                    future.result()
            except BrokenProcessPool as error:
                raise DatasetError(
                    "a worker process died, most likely killed for want of memory. Finished shards are kept: "
                    "repeat the command, perhaps with fewer --workers"
                ) from error
            yield


_tally: _Tally | None = None
"""Of this worker's parent."""


def _start_worker(tally: _Tally) -> None:
    global _tally
    _tally = tally
    prepare_worker()
    worker.load_libraries()


def _count_success() -> None:
    assert _tally is not None
    with _tally.successes.get_lock():
        _tally.successes.value += 1


@contextmanager
def _count_cpu_time() -> Iterator[None]:
    assert _tally is not None
    start_s = time.process_time()
    yield
    with _tally.cpu_seconds.get_lock():
        _tally.cpu_seconds.value += time.process_time() - start_s


def _record(settings: GenerationSettings, shard: Shard, target: Path) -> None:
    with _count_cpu_time():
        worker.record(settings, shard, target, _count_success)


def _merge(job: MergeJob) -> None:
    from lerobot_env_bimanual.generation.merging import merge_shards
    from lerobot_env_bimanual.generation.staging import plain_write_errors

    with _count_cpu_time(), plain_write_errors(job.root):
        merge_shards(job)
