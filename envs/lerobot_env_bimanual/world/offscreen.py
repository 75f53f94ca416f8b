"""An off-screen OpenGL context that draws scenes of one model."""

import atexit
import contextlib
import threading
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import device_chosen, missing_gl, mujoco

MAX_GEOMS = 2000

COARSE_SHADOWS = 512
"""Pixels of a shadow map's side: about 4 mm on the table."""

_making_a_context = threading.Lock()  # MuJoCo and its bindings keep display and drivers in globals


@dataclass(frozen=True)
class Quality:
    """Cost and look of an image.

    Attributes:
        samples: per pixel; 0 is no anti-aliasing.
        shadow_map_size: pixels of the shadow map's side; 0 is no shadows.
        slices: facets around a round shape; half as many along it.
        quads: squares along the side of a box, at whose corners light is computed.
    """

    samples: int
    shadow_map_size: int
    slices: int
    quads: int

    def with_shadows(self) -> "Quality":
        """This quality with shadows, as coarse as will do where it has none."""
        return replace(self, shadow_map_size=self.shadow_map_size or COARSE_SHADOWS)

    @property
    def is_plain(self) -> bool:
        """Whether each pixel is the colour of one geom, on which nothing else has an influence."""
        return self.samples == 0 and self.shadow_map_size == 0


class Pixels(NamedTuple):
    """What one camera sees, top row first.

    Attributes:
        rgb: (height, width, 3) uint8.
        nearness: (height, width) float32, depth as OpenGL keeps it: 1 at the near plane, 0 at the far plane and where
            nothing is. Unlike 1 minus it, it tells apart all that the depth test told apart.
    """

    rgb: NDArray[np.uint8]
    nearness: NDArray[np.float32]


class Offscreen:
    """A frame buffer, with the model's meshes and textures in the driver's memory.

    Attributes:
        quality: as given.
        aspect: width of the images over their height.
        free: gives all of it back; called at interpreter exit if not before.
    """

    def __init__(self, model: mujoco.MjModel, height: int, width: int, quality: Quality):
        """Make the context; raises `MissingGL` where none can be made."""
        self._model = model
        self.quality = quality
        self.aspect = width / height
        self._shape = (height, width)
        self._rect = mujoco.MjrRect(0, 0, width, height)
        try:
            with _offscreen_settings(model, height, width, quality), _making_a_context, device_chosen():
                gl = mujoco.GLContext(width, height)
                gl.make_current()
                self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        except (AttributeError, ImportError, RuntimeError, ValueError, mujoco.FatalError) as error:
            raise missing_gl(error) from error
        self._gl = gl
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        self._mjr.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self.free = weakref.finalize(self, _free, gl, self._mjr)
        # At interpreter exit the driver goes when MuJoCo says, which has said so by now; what is said later comes first.
        self.free.atexit = False
        atexit.register(self.free)

    def make_scene(self) -> mujoco.MjvScene:
        """An empty list of what to draw."""
        scene = mujoco.MjvScene(self._model, MAX_GEOMS)
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self.quality.shadow_map_size > 0
        return scene

    def make_current(self) -> None:
        """Let the calling thread draw."""
        self._gl.make_current()

    def draw(self, scene: mujoco.MjvScene, data: mujoco.MjData, camera_id: int) -> Pixels:
        """A fresh image of a scene from one of the model's cameras."""
        rgb = np.empty((*self._shape, 3), np.uint8)
        nearness = np.empty(self._shape, np.float32)
        self._camera.fixedcamid = camera_id
        mujoco.mjv_updateCamera(self._model, data, self._camera, scene)
        mujoco.mjr_render(self._rect, scene, self._mjr)
        mujoco.mjr_readPixels(rgb, nearness, self._rect, self._mjr)
        return Pixels(np.ascontiguousarray(rgb[::-1]), np.ascontiguousarray(nearness[::-1]))

    def depth_m(self, nearness: NDArray[np.float32]) -> NDArray[np.float32]:
        """Metres along the optical axis, of the same shape."""
        extent = self._model.stat.extent
        near, far = self._model.vis.map.znear * extent, self._model.vis.map.zfar * extent
        depth = (np.float32(1) - nearness).astype(np.float64)  # rounded as MuJoCo hands depth out: 1 is far
        depth *= near - far
        depth += far
        np.divide(near * far, depth, out=depth)
        return depth.astype(np.float32)


def _free(gl, mjr) -> None:
    gl.make_current()
    mjr.free()
    gl.free()


@contextlib.contextmanager
def _offscreen_settings(model: mujoco.MjModel, height: int, width: int, quality: Quality) -> Iterator[None]:
    """Lend the model the frame-buffer settings that MuJoCo reads from it when a context is made."""
    lent = (
        (model.vis.global_, "offheight", height),
        (model.vis.global_, "offwidth", width),
        (model.vis.quality, "offsamples", quality.samples),
        (model.vis.quality, "shadowsize", quality.shadow_map_size),
        (model.vis.quality, "numslices", quality.slices),
        (model.vis.quality, "numstacks", quality.slices // 2),
        (model.vis.quality, "numquads", quality.quads),
    )
    kept = [getattr(section, field) for section, field, _ in lent]
    for section, field, value in lent:
        setattr(section, field, value)
    try:
        yield
    finally:
        for (section, field, _), value in zip(lent, kept, strict=True):
            setattr(section, field, value)
