"""One worker process: what it does, and how its parent speaks with it."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from multiprocessing import connection
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from lerobot_bimanual.errors import BimanualError


class WorkFailed(BimanualError):
    """An item could not be worked on for a reason that nobody foresaw."""


@dataclass(frozen=True)
class Failure:
    """What comes from a worker instead of a result.

    Attributes:
        error: what was raised, with the worker's traceback as a note.
        is_of_item: whether another item may succeed; otherwise the worker could not be prepared.
    """

    error: BimanualError
    is_of_item: bool = True


class Worker:
    """A worker process, as its parent sees it.

    Attributes:
        process: the process.
        pipe: carries one item there and its answer back.
        index: number of the item that it works on or has worked on.
        is_busy: whether its answer is awaited.
    """

    def __init__(self, context: BaseContext, prepare: Callable[..., None] | None, arguments: tuple[Any, ...]):
        self.index, self.is_busy = 0, False
        self.pipe, theirs = context.Pipe()
        # A base context has no attribute `Process`, though every context that `get_context` returns has.
        self.process: BaseProcess = context.Process(target=_work, args=(theirs, prepare, arguments))  # pyright: ignore[reportAttributeAccessIssue]
        self.process.start()
        theirs.close()

    def give(self, index: int, function: Callable[[Any], Any], item: Any) -> None:
        """Have it do something with an item."""
        self.index, self.is_busy = index, True
        with suppress(OSError):  # it has just died, which its answer will say
            self.pipe.send((function, item))

    def end(self) -> None:
        """Have it end: at once if it is busy, in good order otherwise."""
        if self.is_busy:
            self.process.terminate()
        else:
            with suppress(OSError):
                self.pipe.send(None)

    def answer(self, name: str) -> Any:
        """What it says; raises EOFError if it has died."""
        self.is_busy = False
        try:
            answer = self.pipe.recv()
        except (EOFError, OSError):
            raise EOFError from None
        except Exception as error:  # a result that can be packed, but not unpacked
            answer = Failure(told(error))
        if isinstance(answer, Failure) and answer.is_of_item and isinstance(answer.error, WorkFailed):
            return Failure(WorkFailed(f"{name}: {answer.error}"))
        return answer


def end_of(process: BaseProcess) -> str:
    """How a process ended that is ending, in words."""
    process.join()
    code = process.exitcode or 0
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


@cache
def end_with_parent() -> None:
    """Have this process end when the one that started it does, whatever it is doing then; nothing in a main process."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_await_end, args=(parent.sentinel,), daemon=True).start()


def told(error: Exception) -> BimanualError:
    """An exception as an error that can travel between processes, with its traceback as a note."""
    if not isinstance(error, BimanualError):
        frames = traceback.extract_tb(error.__traceback__)
        place = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
        text = f"unexpected {type(error).__name__}: {error}{place}"
        error = WorkFailed(text).with_traceback(error.__traceback__)
    error.add_note("".join(traceback.format_tb(error.__traceback__)))
    return error


def _await_end(parent_sentinel: int) -> None:
    connection.wait([parent_sentinel])
    os._exit(1)


def _work(pipe: Connection, prepare: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    """What a worker process does until it is told to end, or nobody is there any more who could."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    obstacle: Failure | None = None
    try:
        if prepare is not None:
            prepare(*arguments)
    except Exception as error:
        obstacle = Failure(told(error), is_of_item=False)
    while True:
        try:
            packed = pipe.recv_bytes()
        except (EOFError, OSError):  # nobody is there any more
            return
        try:
            work = pickle.loads(packed)
            if work is None:
                return
            function, item = work
            answer = function(item) if obstacle is None else obstacle
        except Exception as error:
            answer = Failure(told(error))
        try:
            pipe.send(answer)
        except OSError:
            return
        except Exception as error:  # a result that cannot be packed
            pipe.send(Failure(told(error)))
