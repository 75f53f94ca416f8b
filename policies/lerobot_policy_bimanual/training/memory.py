"""Memory that is freed stays with the process, where that saves time."""

import ctypes
import sys

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
"""Parameters of glibc's `mallopt`."""

LARGEST_KEPT = 2**30
"""Bytes: larger pieces go back to the system at once. A training step on a CPU asks for maps of 10 to 100 MB."""


def keep_freed_memory() -> None:
    """Have glibc keep what is freed, up to `LARGEST_KEPT` a piece, until the process ends.

    Maps of a training step are freed and asked for again at every step. By default glibc gives large ones back to the
    system, which then hands out every page anew, zeroed: up to a third of a step. Does nothing with other C libraries.
    """
    if not sys.platform.startswith("linux"):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(M_MMAP_THRESHOLD, LARGEST_KEPT)
        mallopt(M_TRIM_THRESHOLD, LARGEST_KEPT)
