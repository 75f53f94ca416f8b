"""The pool of worker processes: `concurrent.futures` with ordered results, a progress bar and a retry after a death.

Results depend on items alone, so any number of workers gives the same. Every worker computes on one core, leaves
Ctrl-C to its parent, and ends when its parent does. Where a worker dies, all items that were under way are tried again
one by one, so that the one that kills its worker is known and named.
"""

import atexit
import multiprocessing
import os
import re
import select
import signal
import socket
import sys
import sysconfig
import tempfile
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager, suppress
from multiprocessing import connection, forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Self

from tqdm import tqdm

import lerobot_bimanual
from lerobot_bimanual.errors import BimanualError, check_range
from lerobot_bimanual.interrupts import end_when_parent_ends, interrupts_ignored
from lerobot_bimanual.resources import worker_count

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Read by the libraries of linear algebra when they are loaded, so set before a worker imports anything."""

MAX_TMPDIR = 75
"""Longer names leave no room for the address of a socket in a folder of `multiprocessing`."""

PACKAGES = (Path(__file__).parent, Path(lerobot_bimanual.__file__).parent)
LIBRARIES = (*map(str, PACKAGES), *map(sysconfig.get_path, ("stdlib", "purelib")))
"""Where code lies that no author of a task has written."""

DEATH = (
    "its worker process died, also when it was tried alone: usually memory ran out, so repeat the command with fewer "
    "--workers; otherwise a script starts workers without `if __name__ == '__main__':`"
)


class WorkFailed(BimanualError):
    """An item could not be worked on for an unforeseen reason."""


class WorkerDied(WorkFailed):
    """A worker process ended in the middle of its work."""


class WorkerPool:
    """Worker processes, started as work comes; use it in a `with` statement, which ends them.

    Args:
        workers: number of processes; 0 takes one per core that may be used, if there is memory for them.
        preload: further modules imported once, in the process that workers are forked from; none that opens an OpenGL
            context on import, which does not survive a fork. Only the first pool of a process can have some.

    Raises:
        InvalidChoice: a negative number of workers.
    """

    def __init__(self, workers: int, preload: Sequence[str] = ()):
        check_range("workers", workers, 0)
        os.environ.update(ONE_THREAD)
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([__name__, *preload])
        self._limit = worker_count(workers)
        self._executor: ProcessPoolExecutor | None = None
        self._others: set[BaseProcess] = set()
        self._running: dict[Future[Any], int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

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
            label: text before the bar; without it there is no bar.
            unit: what an item is called.
            done: further items that the bar counts as done from the start.
            name: names an item in errors.
            failed: makes the result of an item whose worker raised something or died, from the item and the reason.
                Without it, that ends the work with an error.
            note: called with an item and its result as soon as there is one, whatever earlier items still take.

        Raises:
            BimanualError: what a worker raised.
            WorkFailed: a worker raised something else.
            WorkerDied: a worker died while it worked on an item, again when the item was tried alone.
        """
        early: dict[int, Result] = {}
        turn, total = 0, done + len(items)
        with (
            tqdm(
                desc=label, total=total, initial=done, unit=unit, smoothing=0, disable=not (label and total)
            ) as progress,
            closing(self._answers(function, items)) as answers,
        ):
            for index, answer in answers:
                if isinstance(answer, BimanualError):
                    if failed is None:
                        if isinstance(answer, WorkFailed):
                            answer.args = (f"{name(items[index])}: {answer}",)  # and it keeps its notes
                        raise answer
                    answer = failed(items[index], str(answer))
                if note is not None:
                    note(items[index], answer)
                progress.update()
                early[index] = answer
                while turn in early:
                    yield early.pop(turn)
                    turn += 1

    def _answers(self, function: Callable[[Any], Any], items: Sequence[Any]) -> Generator[tuple[int, Any]]:
        """(index, result or error) as they come."""
        waiting, suspects = deque(range(len(items))), deque[int]()
        try:
            while waiting or suspects or self._running:
                while waiting and len(self._running) < self._limit:
                    self._submit(function, items, waiting.popleft())
                is_retry = not self._running
                if is_retry:
                    self._end()  # a suspect has the whole machine
                    self._submit(function, items, suspects.popleft())
                finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
                if any(isinstance(future.exception(), BrokenProcessPool) for future in finished):
                    finished, _ = wait(self._running)  # a death breaks the whole pool
                    self._end()
                for future in finished:
                    index, error = self._running.pop(future), future.exception()
                    if not isinstance(error, BrokenProcessPool):
                        yield index, future.result() if error is None else as_picklable_error(error)
                    elif is_retry:
                        yield index, WorkerDied(DEATH)
                    else:
                        suspects.append(index)
        finally:
            if self._running:
                self._end()
                self._running.clear()

    def _submit(self, function: Callable[[Any], Any], items: Sequence[Any], index: int) -> None:
        with clear_errors_of_start():
            if self._executor is None:
                ensure_fork_server()
                self._others = {*multiprocessing.active_children()}
                self._executor = ProcessPoolExecutor(self._limit, self._context, end_with_parent)
            try:
                future = self._executor.submit(_work, function, items[index])
            except BrokenProcessPool as error:  # an idle worker died since the last submission
                future = Future()
                future.set_exception(error)
        self._running[future] = index

    def _end(self) -> None:
        """Shut the processes down if all are idle; otherwise kill them, as unfinished work is lost anyway."""
        executor, self._executor = self._executor, None
        if executor is None:
            return
        if not all(future.done() for future in self._running):
            self._kill()
        try:
            executor.shutdown(cancel_futures=True)
        finally:
            self._kill()  # those that were just being started

    def _kill(self) -> None:
        for process in {*multiprocessing.active_children()} - self._others:
            if isinstance(process, self._context.Process):
                process.kill()


def ensure_fork_server() -> None:
    """Start the process from which workers are forked, unless it runs."""
    with clear_errors_of_start(), interrupts_ignored():
        forkserver.ensure_running()


@contextmanager
def clear_errors_of_start() -> Iterator[None]:
    """Say what workers need where the system refuses to start them.

    Raises:
        BimanualError: it has refused.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        folder = tempfile.gettempdir()
        raise BimanualError(
            f"no worker process can be started: {error}. They need a TMPDIR of at most {MAX_TMPDIR} characters ({folder} "
            f"has {len(folder)}), a writable /dev/shm, and further processes (`ulimit -u`) and open files (`ulimit -n`)"
        ) from error


def end_with_parent() -> None:
    """Make a worker leave Ctrl-C to its parent, and end when its parent ends; does nothing in a main process."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # SIGKILL ends even a busy worker when the fork server ends, which ends with our parent. `await_end`
    # notices a parent that has ended already.
    end_when_parent_ends(signal.SIGKILL, os.getppid())

    def await_end() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=await_end, daemon=True).start()


def _prepare_fork_server() -> None:
    """Make the fork server, from which workers are forked, end with its parent, even during its imports, which may take long.

    It then removes the socket of `multiprocessing`, which a killed parent cannot remove.
    """
    command = "".join(sys.orig_argv[-1:])
    found = re.match(r"from multiprocessing\.forkserver import main; main\((\d+), (\d+)", command)
    if found is None or forkserver.get_inherited_fds() is not None:  # in another process, or a worker
        return
    listener, alive = map(int, found.groups())
    with socket.socket(fileno=os.dup(listener)) as copy:
        address = Path(str(copy.getsockname()))
    parent = os.getppid()

    def remove_socket() -> None:
        with suppress(OSError):
            address.unlink()
            address.parent.rmdir()

    def end_if_alone(*_: object) -> None:
        if os.getppid() != parent or select.select([alive], [], [], 0)[0]:
            remove_socket()
            os._exit(0)

    atexit.register(remove_socket)
    signal.signal(signal.SIGUSR2, end_if_alone)
    end_when_parent_ends(signal.SIGUSR2, parent)
    end_if_alone()  # from the beginning


_prepare_fork_server()


def exit_reason(process: BaseProcess) -> str:
    """How a process ended that is ending, in words."""
    process.join()
    code = process.exitcode or 0
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


def as_picklable_error(error: BaseException) -> BimanualError:
    """An exception as an error that can travel between processes, with its traceback as a note."""
    if not isinstance(error, BimanualError):
        frames = traceback.extract_tb(error.__traceback__)
        # For an error in a task, the message names the line of the task's file, whichever package raised it.
        of_task = [
            each for each in frames if "/tasks/" in each.filename or not each.filename.startswith(LIBRARIES)
        ]
        place = [f" ({Path(each.filename).name}, line {each.lineno})" for each in of_task[-1:] or frames[-1:]]
        text = f"unexpected {type(error).__name__}: {error}{''.join(place)}"
        error = WorkFailed(text).with_traceback(error.__traceback__)
    error.add_note("".join(traceback.format_tb(error.__traceback__)))
    return error


def _work(function: Callable[[Any], Any], item: Any) -> Any:
    """The result, or what was raised as an error that can travel."""
    try:
        return function(item)
    except Exception as error:
        return as_picklable_error(error)
