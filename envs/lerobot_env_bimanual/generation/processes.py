"""Records shards with worker processes of this machine, which import LeRobot once for all of them."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self

from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.generation.plan import Shard
from lerobot_env_bimanual.generation.settings import GenerationSettings
from lerobot_env_bimanual.workers import START_METHOD, WorkerPool, WorkFailed

PRELOADED = ("lerobot_bimanual.dataset.writer",)
"""Seven seconds of LeRobot and torch."""


class Executor(Protocol):
    """Records shards; use it in a `with` statement, which ends everything that it has started."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...

    def record(
        self,
        settings: GenerationSettings,
        shards: Sequence[Shard],
        folder: Callable[[str], Path],
        on_episodes: Callable[[int], object],
    ) -> None:
        """Record shards in any order.

        Args:
            settings: what is recorded.
            shards: what is tried.
            folder: gives the folder of a shard's name; each appears in one piece.
            on_episodes: called with the number of episodes that have been recorded since the last call.

        Raises:
            BimanualError: a shard cannot be recorded or written, or workers died.
        """
        ...


class ProcessExecutor:
    """A pool of processes on this machine; an `Executor`.

    Args:
        workers: number of processes; 0 takes one per core.
    """

    def __init__(self, workers: int):
        # Messages and not counters in shared memory, whose locks outlive processes that are killed. One is far below
        # 4 kB, so it arrives whole or not at all.
        self._news, self._outlet = multiprocessing.get_context(START_METHOD).Pipe(duplex=False)
        self._pool = WorkerPool(workers, _prepare, (self._outlet,), PRELOADED)
        self._on_episodes: Callable[[int], object] = int

    def __enter__(self) -> Self:
        threading.Thread(target=self._listen, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End the processes."""
        self._pool.__exit__(kind, error, traceback)
        self._outlet.close()

    def record(
        self,
        settings: GenerationSettings,
        shards: Sequence[Shard],
        folder: Callable[[str], Path],
        on_episodes: Callable[[int], object],
    ) -> None:
        """See `Executor`."""
        self._on_episodes = on_episodes
        work = [(settings, shard, folder(shard.name)) for shard in shards]
        recorded = self._pool.map(_record, work, "", "", name=lambda item: f"shard {item[1].name}", bar=False)
        try:
            for _ in recorded:
                pass
        except WorkFailed as error:
            raise DatasetError(f"{error}. Finished shards are kept") from error

    def _listen(self) -> None:
        with suppress(EOFError, OSError):  # the pool has ended
            while True:
                self._on_episodes(self._news.recv())


_outlet: Connection | None = None


def _prepare(outlet: Connection) -> None:
    global _outlet
    _outlet = outlet


def _record(work: tuple[GenerationSettings, Shard, Path]) -> None:
    from lerobot_env_bimanual.generation.shard import recorder

    assert _outlet is not None
    outlet = _outlet
    recorder().record(*work, lambda: outlet.send(1))
