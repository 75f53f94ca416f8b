"""An interrupt from the keyboard reaches every process of the terminal; only the one that the user started answers it."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_ignored() -> Iterator[None]:
    """Have processes that are started meanwhile ignore interrupts, so that they do not die with a traceback.

    Whoever starts them ends them. Python lets only the main thread decide this; in others it stays as it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
