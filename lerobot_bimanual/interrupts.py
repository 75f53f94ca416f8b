"""Signals that are answered otherwise for a while."""

import ctypes
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType

PR_SET_PDEATHSIG = 1


@contextmanager
def signal_handled(
    number: int, handler: signal.Handlers | Callable[[int, FrameType | None], None]
) -> Iterator[None]:
    """Answer a signal by a handler meanwhile, unless it is ignored, as by `nohup`.

    Python lets only the main thread decide this; in others it stays as it is.
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


def interrupts_ignored() -> AbstractContextManager[None]:
    """Have processes that are started meanwhile ignore interrupts, so that they do not die with a traceback.

    An interrupt from the keyboard reaches every process of the terminal; the one that starts the others ends them.
    """
    return signal_handled(signal.SIGINT, signal.SIG_IGN)


def end_when_parent_ends(number: signal.Signals) -> None:
    """Have the system send this process a signal when the thread that started it ends, however that is (on Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, number)
