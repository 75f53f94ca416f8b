"""Images of a scene that are put together from what stands still and what moves."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.backdrop import Backdrop, Picture
from lerobot_env_bimanual.world.offscreen import Offscreen

ALL = mujoco.mjtCatBit.mjCAT_ALL.value
STILL = mujoco.mjtCatBit.mjCAT_STATIC.value
MOVING = ALL & ~STILL

SEGMENTATION_FLAGS = (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR)
"""With both, each geom is drawn in a colour that is its number."""


class Composition:
    """The images of one scene, from any of its cameras.

    What stands still (the room, furniture, the bases of the arms) looks to a camera that stands still as it did before,
    so it is drawn again only when it has been put elsewhere or painted. Every image is that of the whole scene, bit for
    bit.

    Args:
        model: of the scene.
        data: its state, read by every `begin`.
        offscreen: where it is drawn.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, offscreen: Offscreen):
        self._model = model
        self._data = data
        self._offscreen = offscreen
        self._options = mujoco.MjvOption()
        self._eye = mujoco.MjvCamera()  # any: positions of geoms do not depend on it
        self._whole, self._still, self._moving = (offscreen.make_scene() for _ in range(3))
        self._still_geoms = np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)
        still_cameras = (model.body_weldid[model.cam_bodyid] == 0) & (
            model.cam_mode == mujoco.mjtCamLight.mjCAMLIGHT_FIXED
        )
        self._still_cameras = np.flatnonzero(still_cameras)
        self._planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        self._hides = (
            offscreen.quality.is_plain
            and (model.mat_rgba[:, 3] == 1).all()
            and not model.mat_reflectance.any()
        )
        self._surroundings = b""
        self._backdrops: dict[int, Backdrop] = {}

    def begin(self) -> None:
        """Take over the positions of all geoms; images of several cameras may follow."""
        self._offscreen.make_current()
        self._update(self._whole, ALL)
        self._update(self._moving, MOVING)
        surroundings = self._read_surroundings()
        if surroundings != self._surroundings:
            self._surroundings = surroundings
            self._backdrops.clear()

    def image(self, camera: int) -> Picture:
        """RGB and metric depth from one camera."""
        if camera in self._still_cameras and self._hides_what_is_behind(camera):
            moving = self._offscreen.draw(self._moving, self._data, camera)
            picture = self._backdrop(camera).behind(moving)
            if picture is not None:
                return picture
        pixels = self._offscreen.draw(self._whole, self._data, camera)
        return pixels.rgb, self._offscreen.depth_m(pixels.nearness)

    def geoms(self, camera: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Geom indices, -1 where none is, and metric depth from one camera."""
        scene = self._whole
        for flag in SEGMENTATION_FLAGS:
            scene.flags[flag] = True
        pixels = self._offscreen.draw(scene, self._data, camera)
        for flag in SEGMENTATION_FLAGS:
            scene.flags[flag] = False
        geoms = np.full(scene.maxgeom + 1, -1, np.int32)  # by the colour, which is 0 where nothing is drawn
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geoms[geom.segid + 1] = geom.objid
        numbers = pixels.rgb.astype(np.int32) @ (1, 2**8, 2**16)
        return geoms[numbers], self._offscreen.depth_m(pixels.nearness)

    def _update(self, scene: mujoco.MjvScene, categories: int) -> None:
        mujoco.mjv_updateScene(self._model, self._data, self._options, None, self._eye, categories, scene)

    def _read_surroundings(self) -> bytes:
        """All of which backdrops are made that a scene may change."""
        data, geoms, cameras = self._data, self._still_geoms, self._still_cameras
        parts = (
            data.geom_xpos[geoms],
            data.geom_xmat[geoms],
            self._model.geom_rgba[geoms],
            data.cam_xpos[cameras],
            data.cam_xmat[cameras],
        )
        return b"".join(part.tobytes() for part in parts)

    def _backdrop(self, camera: int) -> Backdrop:
        if camera not in self._backdrops:
            self._update(self._still, STILL)
            still = self._offscreen.draw(self._still, self._data, camera)
            self._backdrops[camera] = Backdrop(still, self._offscreen)
        return self._backdrops[camera]

    def _hides_what_is_behind(self, camera: int) -> bool:
        """Whether a pixel shows the nearest geom alone: nothing shines through, is mirrored or casts a shadow."""
        model, data = self._model, self._data
        see_through = (model.geom_rgba[:, 3] > 0) & (model.geom_rgba[:, 3] < 1)
        to_camera = data.cam_xpos[camera] - data.geom_xpos[self._planes]
        from_behind = (to_camera * data.geom_xmat[self._planes, 2::3]).sum(
            axis=1
        ) < 0  # such planes are translucent
        return self._hides and not see_through.any() and not from_behind.any()
