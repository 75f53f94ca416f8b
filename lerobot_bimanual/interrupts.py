"""Temporary signal handlers, and a signal when the parent process ends."""

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType
from typing import Any

PR_SET_PDEATHSIG = 1
RERAISE_INTERVAL_S = 1


@contextmanager
def signal_handled(
    number: int, handler: signal.Handlers | Callable[[int, FrameType | None], None]
) -> Iterator[None]:
    """Handle a signal by `handler` inside the block, unless the signal is ignored, as under `nohup`.

    In Python only the main thread can set a handler; in other threads nothing changes.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(number) == signal.SIG_IGN:
        yield
        return
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, before)


@contextmanager
def termination_as_system_exit() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise SystemExit inside the block, so that workers end and temporary files are removed.

    Raises:
        SystemExit: with 128 and the signal's number.
    """
    received_signals: list[int] = []
    alarms: list[Any] = []

    def leave(number: int, _: FrameType | None) -> None:
        received_signals.append(number)
        if not isinstance(sys.exception(), SystemExit):
            # Finalizers and hooks of forks swallow what is raised in them, so it is raised again until something unwinds.
            alarms.append(signal.signal(signal.SIGALRM, leave))
            signal.alarm(RERAISE_INTERVAL_S)
            raise SystemExit(128 + received_signals[0])

    try:
        with signal_handled(signal.SIGTERM, leave), signal_handled(signal.SIGHUP, leave):
            yield
    except Exception as error:
        if received_signals:  # C++ code that calls Python answers with an error of its own
            raise SystemExit(128 + received_signals[0]) from error
        raise
    finally:
        if alarms:
            signal.alarm(0)
            signal.signal(signal.SIGALRM, alarms[0])


def interrupts_ignored() -> AbstractContextManager[None]:
    """Have processes that are started meanwhile ignore interrupts, so that they do not die with a traceback.

    An interrupt from the keyboard reaches every process of the terminal; the one that starts the others ends them.
    """
    return signal_handled(signal.SIGINT, signal.SIG_IGN)


def end_when_parent_ends(number: signal.Signals, parent: int) -> None:
    """Have the system send this process a signal when the thread that started it ends, however that is (on Linux).

    `parent` is the number of the process that started this one, which may have ended already.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)
        if os.getppid() != parent:
            os.kill(os.getpid(), number)
