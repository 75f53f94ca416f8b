"""The only import of MuJoCo: picks an OpenGL backend before `mujoco` is imported, and takes over its warnings.

Every module of this distribution imports MuJoCo with `from lerobot_env_bimanual.gl import mujoco`, because
MuJoCo reads `MUJOCO_GL` once, at import, and without it fails on a machine that has no display although an
off-screen driver is installed.
"""

import contextlib
import ctypes
import logging
import os
import sys


def release_gl() -> None:
    """Leave the calling thread without a current OpenGL context, so that any other thread can use or free it.

    EGL refuses a context that is current elsewhere. The other backends are bound to one thread anyway.
    """
    module = sys.modules.get("mujoco.egl")
    if module is not None and module.EGL_DISPLAY is not None:
        egl = module.EGL
        egl.eglMakeCurrent(module.EGL_DISPLAY, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, egl.EGL_NO_CONTEXT)


# Off-screen EGL when the caller chose nothing and there is no display. Mesa's software rasteriser is kept in the calling
# thread: at 256 pixels its worker threads cost more than they give, and this package runs one process per core. Both are
# only defaults.
if not ("DISPLAY" in os.environ or "WAYLAND_DISPLAY" in os.environ):
    os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "0")

try:
    import mujoco
except AttributeError:
    # What a missing driver library becomes inside PyOpenGL. Physics needs no driver: import without rendering,
    # and let a `Renderer` raise `MissingGL` when one is made.
    wanted = os.environ.get("MUJOCO_GL", "")
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco

    os.environ["MUJOCO_GL"] = wanted

# Its bindings give MuJoCo a clock, which is read thirty times a step for timers that are not used here. As their
# setter puts it back in place of None, the pointer is cleared itself, where the loader finds it.
with contextlib.suppress(OSError, ValueError):
    ctypes.c_void_p.in_dll(ctypes.CDLL(mujoco._callbacks.__file__), "mjcb_time").value = None

# Left alone, MuJoCo appends its warnings to a file MUJOCO_LOG.TXT in the working directory.
mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)

__all__ = ["mujoco", "release_gl"]
