"""Windows of MuJoCo's viewer. MuJoCo is not loaded with this module, as what it draws with is chosen when it is."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mujoco
    from mujoco.viewer import Handle

type OpenWindow = Callable[..., AbstractContextManager[Handle]]
"""Opens a window on a model and its data; `key_callback` is given the code of every key."""


def no_window() -> str:
    """Why no window can be opened; empty if one can."""
    if "DISPLAY" not in os.environ and "WAYLAND_DISPLAY" not in os.environ:
        return "there is no display"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW's own text of the same
        import glfw

        return "" if glfw.init() else "the display cannot be opened"


@contextmanager
def mujoco_window(
    model: mujoco.MjModel, data: mujoco.MjData, key_callback: Callable[[int], None] | None = None
) -> Iterator[Handle]:
    """MuJoCo's own window, in a thread of its own that ends with the `with` block."""
    from mujoco import viewer

    others = threading.enumerate()
    window = viewer.launch_passive(
        model, data, key_callback=key_callback, show_left_ui=False, show_right_ui=False
    )
    threads = [thread for thread in threading.enumerate() if thread not in others]
    try:
        yield window
    finally:
        window.close()
        for thread in threads:  # one that outlives the interpreter crashes it
            thread.join()
