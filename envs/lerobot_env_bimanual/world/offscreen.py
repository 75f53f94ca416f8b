"""An off-screen OpenGL context that draws scenes of one model."""

import atexit
import threading
import weakref
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import choose_gpu, missing_gl, mujoco, release_gl

MAX_GEOMS = 2000

GL_TEXTURE_2D, GL_TEXTURE_CUBE_MAP = 0x0DE1, 0x8513
GL_TEXTURE_MIN_FILTER, GL_NEAREST_MIPMAP_NEAREST = 0x2801, 0x2700
GL_TEXTURE_MAG_FILTER, GL_NEAREST = 0x2800, 0x2600

SOFT_PX = 160
"""Side of the largest images that are drawn twice as large: larger ones have finer edges, and would cost too much."""
COARSE_PX = 256
"""Side of the largest images that show arms by coarse meshes: fine meshes would cost more than everything else."""

_making_a_context = threading.Lock()  # MuJoCo and its bindings keep display and drivers in globals
_drawing = threading.local()
"""`gl`: the context that the thread draws with, from `make_current` to `release`."""


@dataclass(frozen=True)
class Quality:
    """Cost and look of an image.

    Attributes:
        samples: of the driver's anti-aliasing per pixel; 0 is none.
        shadow_map_size: pixels of the shadow map's side; 0 is no shadows.
        slices: facets around a round shape; half as many along it.
        quads: squares along the side of a box, at whose corners light is computed.
        is_supersampled: whether small images are drawn twice as large and averaged.
    """

    samples: int
    shadow_map_size: int
    slices: int
    quads: int
    is_supersampled: bool = False


class Pixels(NamedTuple):
    """One camera's image as OpenGL draws it: bottom row first, and twice as large if `Offscreen.is_supersampled`.

    Attributes:
        rgb: (rows, columns, 3) uint8.
        nearness: (rows, columns) float32, depth as OpenGL keeps it: 1 at the near plane, 0 at the far plane and where
            nothing is hit. Unlike 1 minus this value, it distinguishes all depths that the depth test distinguished.
    """

    rgb: NDArray[np.uint8]
    nearness: NDArray[np.float32]


class Offscreen:
    """A frame buffer, with the model's meshes and textures in the driver's memory.

    Attributes:
        quality: as given.
        is_supersampled: whether images are drawn twice as large and averaged.
        is_coarse: whether coarse meshes are drawn.
        margin: factor by which the drawn view is larger than the image's.
        free: frees all OpenGL resources; called at interpreter exit if not before.
    """

    def __init__(self, model: mujoco.MjModel, height: int, width: int, quality: Quality):
        """Make the context; raises `MissingGL` where none can be made."""
        self._model = model
        self.quality = quality
        self.is_supersampled = quality.is_supersampled and max(height, width) <= SOFT_PX
        self.is_coarse = max(height, width) <= COARSE_PX
        self.margin = 1.0
        if self.is_supersampled:
            # Half a pixel more on each side, so that each image pixel's middle is the middle of a drawn pixel
            # that has neighbours.
            self.margin = 1 + 0.5 / height
            height, width = 2 * height + 1, 2 * width + 1
        self._shape = (height, width)
        self._rect = mujoco.MjrRect(0, 0, width, height)
        try:
            _set_offscreen(model, height, width, quality)
            with _making_a_context, choose_gpu():
                gl = mujoco.GLContext(width, height)
                _make_current(gl)
                self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        except (AttributeError, ImportError, RuntimeError, ValueError, mujoco.FatalError) as error:
            raise missing_gl(error) from error
        self._gl = gl
        if self.is_supersampled:
            self._simplify_textures()
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        self._mjr.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self.free = weakref.finalize(self, _free, gl, self._mjr)
        # MuJoCo's exit handler, which unloads the driver, is registered by now; later handlers run before it.
        self.free.atexit = False
        atexit.register(self.free)

    def make_scene(self) -> mujoco.MjvScene:
        """An empty list of what to draw."""
        scene = mujoco.MjvScene(self._model, MAX_GEOMS)
        scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = self.quality.shadow_map_size > 0
        return scene

    def make_current(self) -> None:
        """Let the calling thread draw, until `release`."""
        _make_current(self._gl)

    def draw(self, scene: mujoco.MjvScene, data: mujoco.MjData, camera_id: int) -> Pixels:
        """What one of the model's cameras sees of a scene."""
        rgb = np.empty((*self._shape, 3), np.uint8)
        nearness = np.empty(self._shape, np.float32)
        self._camera.fixedcamid = camera_id
        mujoco.mjv_updateCamera(self._model, data, self._camera, scene)
        for eye in scene.camera:
            eye.frustum_top *= self.margin
            eye.frustum_bottom *= self.margin
        mujoco.mjr_render(self._rect, scene, self._mjr)
        mujoco.mjr_readPixels(rgb, nearness, self._rect, self._mjr)
        return Pixels(rgb, nearness)

    def rgb(self, drawn: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The colours of an image (height, width, 3), top row first, from those that were drawn."""
        if not self.is_supersampled:
            return np.ascontiguousarray(drawn[::-1])
        # 1 2 1 along columns, then along rows; as lines of bytes NumPy goes several times as fast.
        lines = drawn.reshape(len(drawn), -1)
        sums = lines[1::2].astype(np.uint16)
        sums += sums
        sums += lines[:-1:2]
        sums += lines[2::2]
        means = sums[:, 3:-3] * np.uint16(2)
        means += sums[:, :-6]
        means += sums[:, 6:]
        means += 8
        means >>= 4
        every_second = means.astype(np.uint8).view("V3")[::-1, ::2]
        return np.ascontiguousarray(every_second).view(np.uint8).reshape(len(means), -1, 3)

    def centres[Number: np.generic](self, drawn: NDArray[Number]) -> NDArray[Number]:
        """What was drawn (rows, columns) at the middles of an image's pixels, top row first."""
        return drawn[::-1][1::2, 1::2] if self.is_supersampled else drawn[::-1]

    def depth_m(self, nearness: NDArray[np.float32]) -> NDArray[np.float32]:
        """Metres along the optical axis, of the same shape."""
        extent = self._model.stat.extent
        near, far = self._model.vis.map.znear * extent, self._model.vis.map.zfar * extent
        depth = (np.float32(1) - nearness).astype(np.float64)  # rounded as MuJoCo hands depth out: 1 is far
        depth *= near - far
        depth += far
        np.divide(near * far, depth, out=depth)
        return depth.astype(np.float32)

    def _simplify_textures(self) -> None:
        """Have one texel per drawn pixel instead of eight: a software rasteriser spends most of its time on them."""
        from OpenGL.raw.GL.VERSION import GL_1_0, GL_1_1  # as MuJoCo does, once there is a context

        for texture, kind in zip(self._mjr.texture, self._model.tex_type, strict=False):
            target = GL_TEXTURE_2D if kind == mujoco.mjtTexture.mjTEXTURE_2D else GL_TEXTURE_CUBE_MAP
            GL_1_1.glBindTexture(target, int(texture))
            GL_1_0.glTexParameteri(target, GL_TEXTURE_MIN_FILTER, GL_NEAREST_MIPMAP_NEAREST)
            GL_1_0.glTexParameteri(target, GL_TEXTURE_MAG_FILTER, GL_NEAREST)


def release() -> None:
    """End drawing in the calling thread."""
    _drawing.gl = None
    release_gl()


def _make_current(gl) -> None:
    gl.make_current()
    _drawing.gl = gl


def _free(gl, mjr) -> None:
    interrupted = getattr(_drawing, "gl", None)  # garbage may be collected while another context draws
    gl.make_current()
    mjr.free()
    gl.free()
    if interrupted is not None and interrupted is not gl:
        interrupted.make_current()


def _set_offscreen(model: mujoco.MjModel, height: int, width: int, quality: Quality) -> None:
    """Write what MuJoCo reads from a model when a context is made, and never again."""
    buffer, looks = model.vis.global_, model.vis.quality
    buffer.offheight, buffer.offwidth = height, width
    looks.offsamples, looks.shadowsize = quality.samples, quality.shadow_map_size
    looks.numslices, looks.numstacks, looks.numquads = quality.slices, quality.slices // 2, quality.quads
