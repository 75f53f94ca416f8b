"""Worker processes: one per core, with LeRobot imported once for all of them, gone as soon as their parent is."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from lerobot_bimanual.errors import BimanualError, DatasetError
from lerobot_env_bimanual.generation.candidates import Shard, ShardReport
from lerobot_env_bimanual.generation.settings import GenerationSettings

if TYPE_CHECKING:
    from lerobot_env_bimanual.expert.recorder import Recorder

PRELOADED = ("lerobot_bimanual.dataset.writer",)
"""Imported once, in the process that workers are forked from: seven seconds of LeRobot and torch. Not MuJoCo, as
an OpenGL driver does not survive a fork."""

POLL_S = 0.5


class Workers:
    """A pool of processes that record and merge shards; use it in a `with` statement.

    Args:
        count: number of processes; 0 takes one per core.
    """

    def __init__(self, count: int):
        self.count = count or os.cpu_count() or 1
        os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")  # inherited by the workers
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([*PRELOADED])
        self._others = multiprocessing.active_children()
        self._successes: Synchronized[int] = context.Value("q", 0)
        self._pool = ProcessPoolExecutor(self.count, context, _start_worker, (self._successes,))

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
        return self._successes.get_obj().value

    def record(
        self, settings: GenerationSettings, shards: Sequence[Shard], folder: Callable[[str], Path]
    ) -> Iterator[None]:
        """Record shards in any order; yields now and then while they are under way.

        Raises:
            DatasetError: a shard cannot be written, or a process died.
        """
        yield from self._watch(
            [self._pool.submit(_record_shard, settings, shard, folder(shard.name)) for shard in shards]
        )

    def merge(
        self,
        settings: GenerationSettings,
        command: str,
        shards: Sequence[tuple[Path, ShardReport]],
        root: Path,
        cache: Path,
    ) -> Iterator[None]:
        """Merge shards, see `merging.merge_shards`; yields now and then while that is under way."""
        yield from self._watch([self._pool.submit(_merge_shards, settings, command, shards, root, cache)])

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


_successes: Synchronized[int] | None = None
_recorder: tuple[str, Recorder] | None = None


def _start_worker(successes: Synchronized[int]) -> None:
    """Prepare a process: quiet libraries, one thread, and no life of its own."""
    global _successes
    _successes = successes
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides
    threading.Thread(target=_die_with_parent, daemon=True).start()

    import av.logging
    import datasets
    import pyarrow
    import torch

    torch.set_num_threads(1)
    pyarrow.set_cpu_count(1)
    datasets.disable_progress_bars()
    av.logging.set_libav_level(av.logging.ERROR)
    logging.getLogger("lerobot").setLevel(logging.CRITICAL)


def _die_with_parent() -> None:
    """End this process when its parent ends, however that happens."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _record_shard(settings: GenerationSettings, shard: Shard, target: Path) -> None:
    from lerobot_env_bimanual.generation.shards import make_recorder, record_shard

    global _recorder
    task = shard.candidates[0].task
    if _recorder is None or _recorder[0] != task:
        if _recorder is not None:
            _recorder[1].close()
        _recorder = task, make_recorder(settings, task)
    try:
        record_shard(settings, shard, _recorder[1], target, _count_success)
    except BimanualError as error:
        raise DatasetError(str(error)) from None  # errors with other arguments do not survive the way home


def _count_success() -> None:
    assert _successes is not None
    with _successes.get_lock():
        _successes.value += 1


def _merge_shards(
    settings: GenerationSettings,
    command: str,
    shards: Sequence[tuple[Path, ShardReport]],
    root: Path,
    cache: Path,
) -> None:
    from lerobot_env_bimanual.generation.merging import merge_shards
    from lerobot_env_bimanual.generation.staging import plain_write_errors

    with plain_write_errors(root):
        merge_shards(settings, command, shards, root, cache)
