"""The one pool of worker processes, for all that is done on several cores.

Workers leave an interrupt from the keyboard to their parent and end when it ends, however that happens. Each
computes on one core and on one item at a time, so that it is known which item a dead worker took along: that one is
tried again, alone, when all others are done. Results depend on items alone, so any number of workers gives the same.
"""

from __future__ import annotations

import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing
from multiprocessing import connection, forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from types import TracebackType
from typing import Any, Self

from tqdm import tqdm

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.interrupts import interrupts_ignored
from lerobot_env_bimanual.scratch import use_scratch_folder
from lerobot_env_bimanual.worker import Failure, Worker, WorkFailed, end_of

START_METHOD = "forkserver"
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Read by the libraries of linear algebra when they are loaded, so before any code of a worker."""

MAX_DEATHS = 2
"""Of workers over one item, before it is given up."""


class WorkerDied(WorkFailed):
    """A worker process ended in the middle of its work."""


class WorkerPool:
    """Worker processes, started as work comes; use it in a `with` statement, which ends them.

    Args:
        workers: number of processes; 0 takes one per core.
        prepare: called once in every worker, before its first work.
        arguments: of `prepare`.
        preload: further modules imported once, in the process that workers are forked from; none that opens an OpenGL
            context on import, which does not survive a fork. Only the first pool of a process can have some.

    Raises:
        InvalidChoice: a negative number of workers.
    """

    def __init__(
        self,
        workers: int,
        prepare: Callable[..., None] | None = None,
        arguments: tuple[Any, ...] = (),
        preload: Sequence[str] = (),
    ):
        if workers < 0:
            raise InvalidChoice("workers", workers, ["a number of processes", "0 for one per core"])
        os.environ.update(ONE_THREAD)
        use_scratch_folder()
        self._context = worker_context()
        self._context.set_forkserver_preload(["lerobot_env_bimanual.worker", *preload])
        self._limit = workers or os.cpu_count() or 1
        self._preparation = (prepare, arguments)
        self._workers: list[Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End the processes."""
        self._dismiss(self._workers)

    def map[Item, Result](
        self,
        function: Callable[[Item], Result],
        items: Sequence[Item],
        label: str,
        unit: str,
        done: int = 0,
        name: Callable[[Item], str] = str,
        failed: Callable[[Item, str], Result] | None = None,
        note: Callable[[Item, Result], None] | None = None,
    ) -> Iterator[Result]:
        """The results in the order of the items, with a progress bar.

        Args:
            function: what a worker does with an item.
            items: what there is to do.
            label: what stands before the bar.
            unit: what an item is called.
            done: further items that the bar counts as done from the start.
            name: names an item in messages.
            failed: makes the result of an item whose worker raised something or died, from the item and the reason.
                Without it, that ends the work with an error.
            note: called with an item and its result as soon as there is one, whatever earlier items still take.

        Raises:
            BimanualError: what a worker raised.
            WorkFailed: a worker raised something else.
            WorkerDied: a worker was killed, twice over the same item.
        """
        early: dict[int, Result] = {}
        turn = 0
        with (
            tqdm(desc=label, total=done + len(items), initial=done, unit=unit, smoothing=0) as bar,
            closing(self._answers(function, items, name)) as answers,
        ):
            for answered in answers:
                assert answered is not None  # it waits for as long as it takes
                index, answer = answered
                if isinstance(answer, Failure):
                    if failed is None or not answer.is_of_item:
                        raise answer.error
                    answer = failed(items[index], str(answer.error))
                if note is not None:
                    note(items[index], answer)
                bar.update()
                early[index] = answer
                while turn in early:
                    yield early.pop(turn)
                    turn += 1

    def run[Item](
        self,
        function: Callable[[Item], None],
        items: Sequence[Item],
        poll_s: float,
        name: Callable[[Item], str] = str,
    ) -> Iterator[None]:
        """Do something with each item, in any order; yields every `poll_s` seconds or more often until all is done.

        Raises:
            BimanualError: what a worker raised, at once.
            WorkFailed: workers raised something else or died, after all other items are done.
        """
        failures: list[BimanualError] = []
        with closing(self._answers(function, items, name, poll_s)) as answers:
            for answered in answers:
                if answered is not None and isinstance(failure := answered[1], Failure):
                    if not failure.is_of_item or not isinstance(failure.error, WorkFailed):
                        raise failure.error
                    failures.append(failure.error)
                yield
        if failures:
            raise failures[0] if len(failures) == 1 else WorkFailed("; ".join(map(str, failures)))

    def _answers(
        self,
        function: Callable[[Any], Any],
        items: Sequence[Any],
        name: Callable[[Any], str],
        poll_s: float | None = None,
    ) -> Generator[tuple[int, Any] | None]:
        """(index, result or failure) as they come, and None whenever nothing came for `poll_s` seconds."""
        waiting = deque(range(len(items)))
        suspects: deque[int] = deque()
        deaths = [0] * len(items)
        busy: dict[Connection, Worker] = {}
        try:
            while waiting or suspects or busy:
                if not (waiting or busy):
                    self._dismiss(self._workers)  # a suspect has the whole machine
                    waiting.append(suspects.popleft())
                while waiting and len(busy) < self._limit:
                    worker = self._idle_worker(busy)
                    worker.give(waiting[0], function, items[waiting[0]])
                    busy[worker.pipe] = worker
                    waiting.popleft()
                ready = connection.wait([*busy], poll_s)
                for pipe in ready:
                    assert isinstance(pipe, Connection)
                    worker = busy.pop(pipe)
                    index = worker.index
                    try:
                        answer = worker.answer(name(items[index]))
                    except EOFError:
                        deaths[index] += 1
                        end = end_of(worker.process)
                        self._dismiss([worker])
                        if deaths[index] < MAX_DEATHS:
                            suspects.append(index)
                            continue
                        answer = Failure(_death(name(items[index]), end))
                    yield index, answer
                if not ready:
                    yield None
        finally:
            self._dismiss([*busy.values()])

    def _idle_worker(self, busy: dict[Connection, Worker]) -> Worker:
        for worker in self._workers:
            if worker.pipe not in busy:
                if worker.process.is_alive():
                    return worker
                self._dismiss([worker])
                break
        with interrupts_ignored():
            forkserver.ensure_running()
        worker = Worker(self._context, *self._preparation)
        self._workers.append(worker)
        return worker

    def _dismiss(self, workers: Sequence[Worker]) -> None:
        """End workers; busy ones at once, as what they have not finished is lost anyway."""
        ended = [*workers]
        for worker in ended:
            worker.end()
        for worker in ended:
            worker.process.join()
            worker.pipe.close()
            self._workers.remove(worker)


def worker_context() -> BaseContext:
    """How workers are started; what they share with their parent is made by it, too."""
    return multiprocessing.get_context(START_METHOD)


def _death(name: str, end: str) -> WorkerDied:
    return WorkerDied(
        f"{name}: its worker process died {MAX_DEATHS} times ({end}), most likely killed for want of memory: repeat "
        "the command, perhaps with fewer --workers"
    )
