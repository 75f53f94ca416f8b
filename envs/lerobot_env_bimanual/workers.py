"""What every worker process of this package does first."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from multiprocessing import connection


def use_one_thread_per_process() -> None:
    """Keep linear algebra in processes started from now on to one core each; call it in the parent.

    Libraries read these variables when they are loaded, so a worker that sets them itself is too late.
    """
    os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")


def prepare_worker() -> None:
    """Leave an interrupt from the keyboard to the parent, and end when the parent ends, however that happens."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
