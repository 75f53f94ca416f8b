"""Images of a scene, of which no more is drawn than has to be."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.backdrop import Backdrop, Picture
from lerobot_env_bimanual.world.offscreen import Offscreen
from lerobot_env_bimanual.world.view_volume import in_view, reach_planes

ALL = mujoco.mjtCatBit.mjCAT_ALL.value
STILL = mujoco.mjtCatBit.mjCAT_STATIC.value
MOVING = ALL & ~STILL

HIDDEN_GROUP = mujoco.mjNGROUP - 1
"""Of geoms that are not drawn."""

SEGMENTATION_FLAGS = (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR)
"""With both, each geom is drawn in a colour that is its number."""


class Composition:
    """The images of one scene from its cameras, each that of the whole scene, bit for bit.

    What stands still (the room, furniture, the bases of the arms) looks to a camera that stands still as it did before,
    so it is drawn again only when some of it has been put elsewhere or painted. For a camera that moves, what is out of
    view is left out, and floor and walls come last, where only what nothing hides is shaded.

    Args:
        model: of the scene.
        data: its state, read by every `begin`.
        offscreen: where it is drawn.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, offscreen: Offscreen):
        self._model = model
        self._data = data
        self._offscreen = offscreen
        self._options, self._no_sites = mujoco.MjvOption(), mujoco.MjvOption()
        self._no_sites.sitegroup[:] = 0
        self._eye = mujoco.MjvCamera()  # any: where geoms are does not depend on it
        self._whole, self._still, self._moving, self._view = (offscreen.make_scene() for _ in range(4))
        is_still = model.body_weldid[model.geom_bodyid] == 0
        self._still_geoms, self._moving_geoms = np.flatnonzero(is_still), np.flatnonzero(~is_still)
        self._planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        is_fixed = model.cam_mode == mujoco.mjtCamLight.mjCAMLIGHT_FIXED
        self._still_cameras = np.flatnonzero(is_fixed & (model.body_weldid[model.cam_bodyid] == 0))
        self._surroundings = b""
        self._backdrops: dict[int, Backdrop] = {}
        self._drawn_last = np.zeros(model.ngeom, bool)

    def begin(self) -> None:
        """Take over where everything is; images of several cameras may follow."""
        self._offscreen.make_current()
        self._list(self._whole, ALL)
        self._list(self._moving, MOVING)
        surroundings = self._read_surroundings()
        if surroundings != self._surroundings:
            self._surroundings = surroundings
            self._backdrops.clear()
            self._drawn_last[self._still_geoms] = self._reach_planes(self._still_geoms)
        self._is_opaque = self._offscreen.quality.is_plain and not self._see_through()

    def image(self, camera: int) -> Picture:
        """RGB and metric depth from one camera."""
        picture = None
        if self._is_opaque and camera in self._still_cameras:
            moving = self._offscreen.draw(self._moving, self._data, camera)
            picture = self._backdrop(camera).behind(moving)
        if picture is None:
            scene = self._list_view(camera) if self._is_opaque else self._whole
            pixels = self._offscreen.draw(scene, self._data, camera)
            picture = pixels.rgb, self._offscreen.depth_m(pixels.nearness)
        return picture

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

    def _list(self, scene: mujoco.MjvScene, categories: int) -> None:
        mujoco.mjv_updateScene(self._model, self._data, self._options, None, self._eye, categories, scene)

    def _list_view(self, camera: int) -> mujoco.MjvScene:
        """What is in view of a camera, with what stands at the room's planes after all the rest.

        Which of two equally near geoms is seen depends on which is drawn first, so nothing may touch across that order.
        """
        seen = in_view(self._model, self._data, camera, self._offscreen.aspect)
        last = seen & self._drawn_last
        if self._reach_planes(self._moving_geoms).any():
            last[:] = False
        groups = self._model.geom_group
        kept = groups.copy()
        try:
            groups[~seen | last] = HIDDEN_GROUP
            self._list(self._view, ALL)
            groups[:] = np.where(last, kept, HIDDEN_GROUP)
            mujoco.mjv_addGeoms(
                self._model, self._data, self._no_sites, mujoco.MjvPerturb(), STILL, self._view
            )
        finally:
            groups[:] = kept
        return self._view

    def _backdrop(self, camera: int) -> Backdrop:
        if camera not in self._backdrops:
            self._list(self._still, STILL)
            still = self._offscreen.draw(self._still, self._data, camera)
            self._backdrops[camera] = Backdrop(still, self._offscreen)
        return self._backdrops[camera]

    def _read_surroundings(self) -> bytes:
        """All of which backdrops are made that a scene may change."""
        data, geoms, cameras = self._data, self._still_geoms, self._still_cameras
        fields = (
            data.geom_xpos[geoms],
            data.geom_xmat[geoms],
            self._model.geom_rgba[geoms],
            data.cam_xpos[cameras],
            data.cam_xmat[cameras],
        )
        return b"".join(field.tobytes() for field in fields)

    def _reach_planes(self, geoms: NDArray[np.intp]) -> NDArray[np.bool_]:
        return reach_planes(self._model, self._data, geoms, self._planes)

    def _see_through(self) -> bool:
        """Whether something lets through or mirrors what is behind or before it."""
        model = self._model
        alpha = np.concatenate([model.geom_rgba[:, 3], model.mat_rgba[:, 3]])
        return bool(((alpha > 0) & (alpha < 1)).any() or model.mat_reflectance.any())
