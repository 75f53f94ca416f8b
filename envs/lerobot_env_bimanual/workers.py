"""The one pool of worker processes, for all that is done on several cores.

Workers leave an interrupt from the keyboard to their parent and end when it ends, however that happens. Each
computes on one core. An answer that never comes, because a worker was killed, is a `WorkerDied` and no riddle.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection
from multiprocessing.context import BaseContext
from types import TracebackType
from typing import Any, Self

from tqdm import tqdm

from lerobot_bimanual.errors import BimanualError

START_METHOD = "forkserver"
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Read by the libraries of linear algebra when they are loaded, so before any code of a worker."""


class WorkerDied(BimanualError):
    """A worker process ended in the middle of its work."""


class WorkerPool:
    """Worker processes, started as work comes; use it in a `with` statement, which ends them.

    Args:
        workers: number of processes; 0 takes one per core.
        prepare: called once in every worker, before its first work.
        arguments: of `prepare`.
        preload: modules imported once, in the process that workers are forked from; none that opens an OpenGL context
            on import, which does not survive a fork. Only the first pool of a process can have some.
    """

    def __init__(
        self,
        workers: int,
        prepare: Callable[..., None] | None = None,
        arguments: tuple[Any, ...] = (),
        preload: Sequence[str] = (),
    ):
        os.environ.update(ONE_THREAD)
        context = worker_context()
        context.set_forkserver_preload([*preload])
        self._others = multiprocessing.active_children()
        self._processes = ProcessPoolExecutor(
            workers or os.cpu_count() or 1, context, _start, (prepare, arguments)
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End the processes; at once if the block failed, as what they have not finished is lost anyway."""
        if error is not None:
            for child in set(multiprocessing.active_children()) - set(self._others):
                child.terminate()
        self._processes.shutdown(cancel_futures=True)

    def map[Item, Result](
        self, function: Callable[[Item], Result], items: Sequence[Item], label: str, unit: str, done: int = 0
    ) -> Iterator[Result]:
        """The results in the order of the items, with a progress bar.

        Args:
            function: what a worker does with an item.
            items: what there is to do.
            label: what stands before the bar.
            unit: what an item is called.
            done: further items that the bar counts as done from the start.

        Raises:
            WorkerDied: a worker was killed.
        """
        with _named_death():
            results = self._processes.map(function, items)
            yield from tqdm(results, label, done + len(items), initial=done, unit=unit, smoothing=0)

    def run[Item](
        self, function: Callable[[Item], None], items: Sequence[Item], poll_s: float
    ) -> Iterator[None]:
        """Do something with each item, in any order; yields every `poll_s` seconds or more often until all is done.

        Raises:
            WorkerDied: a worker was killed.
        """
        with _named_death():
            waiting = {self._processes.submit(function, item) for item in items}
            while waiting:
                done, waiting = wait(waiting, timeout=poll_s, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
                yield


def worker_context() -> BaseContext:
    """How workers are started; what they share with their parent is made by it, too."""
    return multiprocessing.get_context(START_METHOD)


@contextmanager
def _named_death() -> Iterator[None]:
    try:
        yield
    except BrokenProcessPool as error:
        raise WorkerDied(
            "a worker process died, most likely killed for want of memory: repeat the command, perhaps with fewer "
            "--workers"
        ) from error


def _start(prepare: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, daemon=True).start()
    if prepare is not None:
        prepare(*arguments)


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
