"""Images of a scene, of which no more is drawn than has to be."""

import contextlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.backdrop import Backdrop
from lerobot_env_bimanual.world.offscreen import Offscreen, Pixels
from lerobot_env_bimanual.world.view_volume import in_view, reach_planes

ALL = mujoco.mjtCatBit.mjCAT_ALL.value
ASLEEP = mujoco.mjtSleepState.mjS_ASLEEP.value
HIDDEN_GROUP = mujoco.mjNGROUP - 1
"""Of geoms that are not drawn."""

SEGMENTATION_FLAGS = (mujoco.mjtRndFlag.mjRND_SEGMENT, mujoco.mjtRndFlag.mjRND_IDCOLOR)
"""With both, each geom is drawn in a colour that is its number."""

type Geoms = NDArray[np.bool_]
"""(ngeom,) some of a model's geoms."""

type Picture = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""RGB (height, width, 3) and depth (height, width) in metres along the optical axis."""


class Composition:
    """The images of one scene from its cameras, each that of the whole scene, bit for bit.

    For a camera in the room only what moves is drawn, over a backdrop: the room itself (with furniture and the bases of
    the arms), drawn again when some of it is put elsewhere or painted, and the props that sleep, until one of them is
    moved. For a camera on a hand, what is out of view is left out, and floor and walls come last, where only what nothing
    hides is shaded.

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
        self._moving, self._others = offscreen.make_scene(), offscreen.make_scene()
        self._planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._room: Geoms = model.body_weldid[model.geom_bodyid] == 0
        self._asleep: Geoms = np.zeros_like(self._room)
        self._looks_of_room, self._looks_of_sleepers = b"", b""
        self._rooms: dict[int, Backdrop] = {}
        self._backdrops: dict[int, Backdrop | None] = {}

    def begin(self, appearance: bytes = b"") -> None:
        """Take over where everything is; images of several cameras may follow.

        Args:
            appearance: fingerprint of what the model wears, but for what stands in `_looks`.
        """
        self._offscreen.make_current()
        looks_of_room = appearance + self._looks(self._room)
        has_new_room = looks_of_room != self._looks_of_room
        if has_new_room:
            self._looks_of_room = looks_of_room
            self._rooms.clear()
        if has_new_room or self._looks(self._asleep) != self._looks_of_sleepers:
            self._asleep = self._data.body_awake[self._model.geom_bodyid] == ASLEEP
            self._looks_of_sleepers = self._looks(self._asleep)
            self._backdrops.clear()
        self._list(self._moving, ~self._room & ~self._asleep, self._options)
        self._is_simple = self._each_pixel_shows_one_geom()
        # Of geoms that are equally near the one drawn last is seen, so what touches the floor stays after it in the order;
        # where that is more than the room itself, all keep their places.
        at_planes = reach_planes(self._model, self._data, self._planes)
        self._drawn_last = np.zeros_like(at_planes) if (at_planes & ~self._room).any() else at_planes

    def image(self, camera: int) -> Picture:
        """RGB and metric depth from one camera."""
        if self._is_simple and self._model.cam_bodyid[camera] == 0:
            backdrop = self._backdrop(camera)
            both = backdrop and backdrop.behind(self._draw(self._moving, camera))
            if both is not None:
                return both.rgb, both.depth_m
        if self._is_simple:
            self._list_view(camera)
        else:
            self._list(self._others, np.ones_like(self._room), self._options)
        pixels = self._draw(self._others, camera)
        return pixels.rgb, self._offscreen.depth_m(pixels.nearness)

    def geoms(self, camera: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Geom indices, -1 where none is, and metric depth from one camera."""
        scene = self._others
        self._list(scene, np.ones_like(self._room), self._options)
        for flag in SEGMENTATION_FLAGS:
            scene.flags[flag] = True
        pixels = self._draw(scene, camera)
        for flag in SEGMENTATION_FLAGS:
            scene.flags[flag] = False
        geoms = np.full(scene.maxgeom + 1, -1, np.int32)  # by the colour, which is 0 where nothing is drawn
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                geoms[geom.segid + 1] = geom.objid
        numbers = pixels.rgb.astype(np.int32) @ (1, 2**8, 2**16)
        return geoms[numbers], self._offscreen.depth_m(pixels.nearness)

    def _backdrop(self, camera: int) -> Backdrop | None:
        """Room and sleeping props; None where they cannot be drawn apart."""
        if camera not in self._rooms:
            self._rooms[camera] = Backdrop(self._draw_geoms(self._room, camera), self._offscreen)
        if camera not in self._backdrops and self._sees_through_a_wall(camera):
            self._backdrops[camera] = None
        if camera not in self._backdrops:
            sleepers = self._draw_geoms(self._asleep, camera)
            self._backdrops[camera] = self._rooms[camera].behind(sleepers)
        return self._backdrops[camera]

    def _draw_geoms(self, geoms: Geoms, camera: int) -> Pixels:
        self._list(self._others, geoms, self._no_sites)
        return self._draw(self._others, camera)

    def _draw(self, scene: mujoco.MjvScene, camera: int) -> Pixels:
        return self._offscreen.draw(scene, self._data, camera)

    def _list(self, scene: mujoco.MjvScene, geoms: Geoms, options: mujoco.MjvOption) -> None:
        """Fill a scene with geoms, as far as they are for the eye, and with the sites that the options show."""
        with self._shown(geoms):
            mujoco.mjv_updateScene(self._model, self._data, options, None, self._eye, ALL, scene)

    def _list_view(self, camera: int) -> None:
        """Fill a scene with what is in view of a camera, and with what is at the room's planes after all the rest."""
        seen = in_view(self._model, self._data, camera, self._offscreen.aspect)
        self._list(self._others, seen & ~self._drawn_last, self._options)
        with self._shown(seen & self._drawn_last):
            mujoco.mjv_addGeoms(
                self._model, self._data, self._no_sites, mujoco.MjvPerturb(), ALL, self._others
            )

    @contextlib.contextmanager
    def _shown(self, geoms: Geoms) -> Iterator[None]:
        """Hide all other geoms, by lending the model groups that are not drawn."""
        groups = self._model.geom_group
        kept = groups.copy()
        groups[~geoms] = HIDDEN_GROUP
        try:
            yield
        finally:
            groups[:] = kept

    def _looks(self, geoms: Geoms) -> bytes:
        """All about geoms that a scene may change."""
        data, model = self._data, self._model
        fields = (data.geom_xpos, data.geom_xmat, model.geom_rgba)
        return b"".join(field[geoms].tobytes() for field in fields)

    def _each_pixel_shows_one_geom(self) -> bool:
        """Whether nothing lets through, mirrors or shades what is behind or before it."""
        model = self._model
        alpha = np.concatenate([model.geom_rgba[:, 3], model.mat_rgba[:, 3]])
        is_opaque = ((alpha == 0) | (alpha == 1)).all() and not model.mat_reflectance.any()
        return bool(is_opaque and self._offscreen.quality.is_plain)

    def _sees_through_a_wall(self, camera: int) -> bool:
        """Whether a camera is behind a plane, which MuJoCo draws translucent from there."""
        to_camera = self._data.cam_xpos[camera] - self._data.geom_xpos[self._planes]
        return bool(((to_camera * self._data.geom_xmat[self._planes, 2::3]).sum(axis=1) < 0).any())
