"""RGB-D images of a scene."""

import atexit
import contextlib
import os
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import InvalidChoice, MissingGL, UnknownCamera
from lerobot_env_bimanual.gl import mujoco, release_gl
from lerobot_env_bimanual.world.scene_view import SceneView

MAX_GEOMS = 2000
SEGMENTATION_FLAGS = (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR)
"""With both, each geom is drawn in a colour that is its number."""

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


# On a software rasteriser shadows and anti-aliasing each cost several times the image itself. Twenty-four facets keep
# the largest prop, a ball of 30 cm, round to 1.3 mm.
QUALITIES = {
    "observation": Quality(samples=0, shadow_map_size=0, slices=24, quads=2),
    "high": Quality(samples=4, shadow_map_size=4096, slices=48, quads=8),
}


class Renderer:
    """Renders one scene from some of its cameras, at one size.

    The OpenGL context is created at the first image and freed by `close`, by the end of a `with` block, or at
    interpreter exit; each in any thread, but one at a time.

    Attributes:
        cameras: names, in the order of the images.
        height: pixels.
        width: pixels.
    """

    def __init__(
        self,
        scene: SceneView,
        cameras: Sequence[str] = CAMERA_NAMES,
        height: int = 256,
        width: int = 256,
        quality: str = "observation",
    ):
        """Prepare; raises `UnknownCamera` or `InvalidChoice` for names that do not exist."""
        for camera in cameras:
            if camera not in CAMERA_NAMES:
                raise UnknownCamera(camera, CAMERA_NAMES)
        if quality not in QUALITIES:
            raise InvalidChoice("quality", quality, QUALITIES)
        self.cameras = tuple(cameras)
        self.height = height
        self.width = width
        self._quality = QUALITIES[quality]
        self._model = scene.model
        self._data = scene.data
        self._context: _Context | None = None

    def render(self) -> dict[str, tuple[NDArray[np.uint8], NDArray[np.float32]]]:
        """One pass per camera.

        Returns:
            Per camera a fresh pair: RGB (height, width, 3) uint8, and depth (height, width) float32 in metres
            along the optical axis. Where nothing is hit, depth is the far plane.

        Raises:
            MissingGL: no OpenGL context can be made on this machine.
        """
        return self._each_camera(_Context.image)

    def segment(self) -> dict[str, tuple[NDArray[np.int32], NDArray[np.float32]]]:
        """Which geom each pixel shows, one pass per camera.

        Returns:
            Per camera a fresh pair: index of the geom (height, width) int32, -1 where nothing is hit, and depth as
            `render` returns it.

        Raises:
            MissingGL: no OpenGL context can be made on this machine.
        """
        return self._each_camera(_Context.geoms)

    def close(self) -> None:
        """Free the OpenGL context; the next `render` makes a new one."""
        if self._context is not None:
            self._context.free()
            atexit.unregister(self._context.free)
            self._context = None

    def _each_camera[Picture](
        self, take: Callable[["_Context", mujoco.MjData, int], Picture]
    ) -> dict[str, Picture]:
        """One picture per camera, each taken in the context, which is made if there is none."""
        try:
            if self._context is None:
                self._context = _Context(self._model, self.height, self.width, self._quality)
            context = self._context
            context.begin(self._data)
            return {
                camera: take(context, self._data, self._model.camera(camera).id) for camera in self.cameras
            }
        finally:
            release_gl()

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Context:
    """An off-screen OpenGL context with the model's meshes and textures in it."""

    def __init__(self, model: mujoco.MjModel, height: int, width: int, quality: Quality):
        self._model = model
        self._shape = (height, width)
        self._rect = mujoco.MjrRect(0, 0, width, height)
        if not hasattr(mujoco, "GLContext"):
            raise MissingGL(
                f"MUJOCO_GL={os.environ.get('MUJOCO_GL')}, but its driver library is not installed"
            )
        try:
            with _offscreen_settings(model, height, width, quality), _making_a_context:
                gl = mujoco.GLContext(width, height)
                gl.make_current()
                self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        except (ImportError, RuntimeError, mujoco.FatalError) as error:
            raise MissingGL(f"{type(error).__name__}: {error}") from error
        self._gl = gl
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        self._scene = mujoco.MjvScene(model, MAX_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = quality.shadow_map_size > 0
        self._options = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = 0
        self.free = weakref.finalize(self, _free, gl, self._mjr)
        # At interpreter exit the driver goes when MuJoCo says, which has said so by now; what is said later comes first.
        self.free.atexit = False
        atexit.register(self.free)

    def begin(self, data: mujoco.MjData) -> None:
        """Take over the positions of all geoms; images of several cameras may follow."""
        self._gl.make_current()
        mujoco.mjv_updateScene(
            self._model, data, self._options, None, self._camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )

    def image(self, data: mujoco.MjData, camera_id: int) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """RGB and metric depth from one camera."""
        rgb, depth = self._pixels(data, camera_id)
        return np.ascontiguousarray(rgb[::-1]), self._metric(depth[::-1])

    def geoms(self, data: mujoco.MjData, camera_id: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Geom indices, -1 where none is, and metric depth from one camera."""
        for flag in SEGMENTATION_FLAGS:
            self._scene.flags[flag] = True
        rgb, depth = self._pixels(data, camera_id)
        for flag in SEGMENTATION_FLAGS:
            self._scene.flags[flag] = False
        geoms = np.full(
            self._scene.maxgeom + 1, -1, np.int32
        )  # by the colour, which is 0 where nothing is drawn
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geoms[geom.segid + 1] = geom.objid
        return geoms[rgb[::-1].astype(np.int32) @ (1, 2**8, 2**16)], self._metric(depth[::-1])

    def _pixels(self, data: mujoco.MjData, camera_id: int) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """What one camera sees, bottom row first, the depth as OpenGL stores it."""
        rgb = np.empty((*self._shape, 3), np.uint8)
        depth = np.empty(self._shape, np.float32)
        self._camera.fixedcamid = camera_id
        mujoco.mjv_updateCamera(self._model, data, self._camera, self._scene)
        mujoco.mjr_render(self._rect, self._scene, self._mjr)
        mujoco.mjr_readPixels(rgb, depth, self._rect, self._mjr)
        return rgb, depth

    def _metric(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Metres along the optical axis of a depth buffer with values 0 (near plane) to 1 (far plane)."""
        extent = self._model.stat.extent
        near, far = self._model.vis.map.znear * extent, self._model.vis.map.zfar * extent
        return (near * far / (far - depth.astype(np.float64) * (far - near))).astype(np.float32)


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
