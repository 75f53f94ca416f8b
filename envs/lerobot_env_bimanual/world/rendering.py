"""RGB-D images of a scene."""

import atexit
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_env_bimanual.world.appearance import applied
from lerobot_env_bimanual.world.composition import Composition
from lerobot_env_bimanual.world.offscreen import Offscreen, Quality, release
from lerobot_env_bimanual.world.scene_view import SceneView

# On a software rasteriser shadows and the driver's anti-aliasing each cost several times the image itself. Twenty
# facets keep the largest prop, a ball of 30 cm, round to 3.6 mm.
QUALITIES = {
    "observation": Quality(samples=0, shadow_map_size=0, slices=20, quads=2, is_supersampled=True),
    "high": Quality(samples=4, shadow_map_size=4096, slices=48, quads=8),
}
COARSE_SHADOWS = 512
"""Side of the shadow map, in pixels, if only the appearance requires shadows: about 4 mm on the table."""


class Renderer:
    """Renders one scene from some of its cameras, at one size.

    The OpenGL context is created at the first image and freed by `close`, by the end of a `with` block, or at
    interpreter exit; each in any thread, but one at a time.

    Args:
        scene: the scene.
        cameras: some of `lerobot_bimanual.cameras.CAMERA_NAMES`.
        height: pixels.
        width: pixels.
        quality: one of `QUALITIES`.

    Attributes:
        cameras: names, in the order of the images.
    """

    def __init__(
        self,
        scene: SceneView,
        cameras: Sequence[str] = CAMERA_NAMES,
        height: int = 256,
        width: int = 256,
        quality: str = "observation",
    ):
        self.cameras = tuple(cameras)
        self._size = height, width
        self._quality = QUALITIES[quality]
        self._scene = scene
        self._offscreen: Offscreen | None = None
        self._composition: Composition | None = None

    def render(self) -> dict[str, tuple[NDArray[np.uint8], NDArray[np.float32]]]:
        """What the cameras see now.

        Returns:
            Per camera a fresh pair: RGB (height, width, 3) uint8, and depth (height, width) float32 in metres
            along the optical axis. Where nothing is hit, depth is the far plane.

        Raises:
            MissingGL: no OpenGL context can be made on this machine.
        """
        model, data, appearance = self._scene.model, self._scene.data, self._scene.appearance
        quality = self._quality
        if appearance.casts_shadows and not quality.shadow_map_size:
            quality = replace(quality, shadow_map_size=COARSE_SHADOWS)
        if self._offscreen is not None and self._offscreen.quality != quality:
            self.close()
        try:
            if self._composition is None:
                self._offscreen = Offscreen(model, *self._size, quality)
                self._composition = Composition(model, data, self._offscreen)
            composition = self._composition
            with applied(model, data, appearance.fields):
                composition.begin(appearance.fingerprint)
                return {camera: composition.image(model.camera(camera).id) for camera in self.cameras}
        finally:
            release()

    def close(self) -> None:
        """Free the OpenGL context; the next `render` makes a new one."""
        if self._offscreen is not None:
            self._offscreen.free()
            atexit.unregister(self._offscreen.free)
            self._offscreen = self._composition = None

    def __enter__(self) -> "Renderer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
