"""The only import of MuJoCo: picks an OpenGL backend before `mujoco` is imported, and takes over its warnings.

Every module of this distribution imports MuJoCo with `from lerobot_env_bimanual.gl import mujoco`, because
MuJoCo reads `MUJOCO_GL` once, at import, and without it fails on a machine that has no display although an
off-screen driver is installed.
"""

import contextlib
import ctypes
import importlib
import logging
import multiprocessing
import os
import re
import sys
from collections.abc import Iterator
from typing import Any

from lerobot_bimanual.errors import BimanualError

DEVICE = "MUJOCO_EGL_DEVICE_ID"
LIBRARIES = (("libEGL.so.1",), ("libGL.so.1", "libOpenGL.so.0"), ("libEGL_mesa.so.0", "libEGL_nvidia.so.0"))
"""What EGL needs: one of each."""
INSTALL = "on Debian or Ubuntu: sudo apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri libgl1"


class MissingGL(BimanualError):
    """No OpenGL context could be created for offscreen rendering."""

    def __init__(self, cause: str, remedy: str = ""):
        super().__init__(f"no offscreen OpenGL context: {cause}{remedy and '; '}{remedy}")


def release_gl() -> None:
    """Leave the calling thread without a current OpenGL context, so that any other thread can use or free it.

    EGL refuses a context that is current elsewhere. The other backends are bound to one thread anyway.
    """
    module = sys.modules.get("mujoco.egl")
    if module is not None and module.EGL_DISPLAY is not None:
        egl = module.EGL
        egl.eglMakeCurrent(module.EGL_DISPLAY, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, egl.EGL_NO_CONTEXT)


def missing_gl(error: Exception) -> MissingGL:
    """The error that says why no context could be made, and how to fix it; `error` is what was raised instead."""
    if WAS_IMPORTED:
        return MissingGL(
            "mujoco was imported before with another backend", "import it later, or set MUJOCO_GL=egl"
        )
    backend = os.environ.get("MUJOCO_GL", "")
    if backend.lower().strip() != "egl":
        return MissingGL(f"MUJOCO_GL is {backend!r}, which draws nothing here", "set MUJOCO_GL=egl")
    if lacking := [names[0] for names in LIBRARIES if not any(map(_opens, names))]:
        return MissingGL(f"{', '.join(lacking)} cannot be opened", INSTALL)
    try:
        importlib.import_module("mujoco.egl")  # MuJoCo does not say why it could not import it
    except Exception as cause:
        error = cause
    if isinstance(error, ValueError):
        return MissingGL(f"{DEVICE} is {os.environ.get(DEVICE)!r}, but must be the number of a device")
    return MissingGL(str(error))


@contextlib.contextmanager
def choose_gpu() -> Iterator[None]:
    """Choose a GPU for the first OpenGL context of this process, if there are several.

    Ranks of a job and their workers are spread over the GPUs in CUDA_VISIBLE_DEVICES; a process whose GPU cannot be used
    takes the next one. If the user has chosen a device, or MuJoCo already has one, nothing changes.
    """
    module: Any = sys.modules.get("mujoco.egl")
    is_open = bool(module) and module.EGL_DISPLAY is None and DEVICE not in os.environ
    devices = module.EGL.eglQueryDevicesEXT() if is_open else []
    gpus = [str(i) for i, device in enumerate(devices) if len(devices) > 1 and not _is_software(device)]
    if len(gpus) < 2:
        yield
        return
    rank = os.environ.get("LOCAL_RANK") or os.environ.get("SLURM_LOCALID") or ""
    numbers = [re.sub(".*?([0-9]*)$", r"\1", name) for name in (rank, multiprocessing.current_process().name)]
    visible = os.environ.get("CUDA_VISIBLE_DEVICES", "").split(",")
    chosen = [gpu for gpu in gpus if gpu in visible] or gpus
    place = sum(map(int, filter(None, numbers))) % len(chosen)
    for os.environ[DEVICE] in (*chosen[place:], *chosen[:place], *map(str, range(len(devices)))):
        if module.create_initialized_egl_device_display() != module.EGL.EGL_NO_DISPLAY:
            break
    try:
        yield
    finally:
        del os.environ[DEVICE]  # not the user's: processes that are started from here choose anew


def _is_software(device: object) -> bool:
    from OpenGL.EGL import EGL_EXTENSIONS
    from OpenGL.EGL.EXT.device_query import eglQueryDeviceStringEXT

    query: Any = eglQueryDeviceStringEXT
    return bool(query) and b"software" in query(device, EGL_EXTENSIONS)


def _opens(library: str) -> bool:
    try:
        return bool(ctypes.CDLL(library))
    except OSError:
        return False


# Off-screen EGL when the caller chose nothing and there is no display. Mesa's software rasteriser is kept in the calling
# thread: at 256 pixels its worker threads cost more than they give, and this package runs one process per core. Both are
# only defaults.
WAS_IMPORTED = "mujoco" in sys.modules and os.environ.get("MUJOCO_GL") != "egl"
if not os.environ.get("MUJOCO_GL") and not ("DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ):
    os.environ["MUJOCO_GL"] = "egl"
os.environ.setdefault("LP_NUM_THREADS", "0")

try:
    import mujoco
except (AttributeError, RuntimeError, ctypes.ArgumentError):
    # A driver is missing, or the backend is unknown; without any OpenGL library PyOpenGL raises an `ArgumentError`. Physics
    # needs no driver: import without rendering, and let a `Renderer` raise `MissingGL` when it is made.
    wanted = os.environ.get("MUJOCO_GL", "")
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco

    os.environ["MUJOCO_GL"] = wanted

# The bindings give MuJoCo a clock, which is read thirty times a step for timers that are not used here. Their
# setter replaces None by that clock, so the pointer in the loaded library is cleared directly.
with contextlib.suppress(OSError, ValueError):
    ctypes.c_void_p.in_dll(ctypes.CDLL(sys.modules["mujoco._callbacks"].__file__), "mjcb_time").value = None

# Left alone, MuJoCo appends its warnings to a file MUJOCO_LOG.TXT in the working directory.
mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)

__all__ = ["choose_gpu", "missing_gl", "mujoco", "release_gl"]
