"""Images of a scene, drawn incrementally: only what has changed, over a backdrop of what has not."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import COARSE, FINE
from lerobot_env_bimanual.world.offscreen import Offscreen, Pixels

ALL = mujoco.mjtCatBit.mjCAT_ALL.value
ASLEEP = mujoco.mjtSleepState.mjS_ASLEEP.value
HIDDEN_GROUP = mujoco.mjNGROUP - 1
"""Group of geoms that are not drawn."""

type Geoms = NDArray[np.bool_]
"""(ngeom,) some of a model's geoms."""

type Picture = tuple[NDArray[np.uint8], NDArray[np.float32]]
"""RGB (height, width, 3) and depth (height, width) in metres along the optical axis."""


class Composition:
    """Draws one scene from its cameras incrementally; each image equals, bit for bit, that of the whole scene drawn at once.

    For a camera in the room, only what moves is drawn, over a backdrop. The backdrop shows the room itself (with furniture
    and the bases of the arms), redrawn when a part of it is moved or recoloured, and the sleeping props, redrawn when one
    is moved. A camera on a hand draws all.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, offscreen: Offscreen):
        self._model = model
        self._data = data
        self._offscreen = offscreen
        self._options, self._no_sites = mujoco.MjvOption(), mujoco.MjvOption()
        self._no_sites.sitegroup[:] = 0
        for options in (self._options, self._no_sites):
            options.geomgroup[[COARSE, FINE]] = offscreen.is_coarse, not offscreen.is_coarse
        self._eye = mujoco.MjvCamera()  # any: where geoms are does not depend on it
        self._moving, self._others = offscreen.make_scene(), offscreen.make_scene()
        self._planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        self._room: Geoms = model.body_weldid[model.geom_bodyid] == 0
        self._asleep: Geoms = np.zeros_like(self._room)
        self._looks_of_room, self._looks_of_sleepers = b"", b""
        self._rooms: dict[int, Backdrop] = {}
        self._backdrops: dict[int, Backdrop | None] = {}

    def begin(self, appearance: bytes) -> None:
        """Prepare images of the present state from any cameras; `appearance` is the fingerprint of the scene's appearance."""
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
        self._is_simple = self._can_composite_by_depth()

    def image(self, camera: int) -> Picture:
        """RGB and metric depth from one camera."""
        if self._is_simple and self._model.cam_bodyid[camera] == 0:
            backdrop = self._backdrop(camera)
            both = backdrop and backdrop.behind(self._offscreen.draw(self._moving, self._data, camera))
            if both is not None:
                return self._offscreen.rgb(both.rgb), both.depth_m
        self._list(self._others, np.ones_like(self._room), self._options)
        pixels = self._offscreen.draw(self._others, self._data, camera)
        nearness = self._offscreen.centres(pixels.nearness)
        return self._offscreen.rgb(pixels.rgb), self._offscreen.depth_m(nearness)

    def _backdrop(self, camera: int) -> Backdrop | None:
        """Room and sleeping props; None where they cannot be drawn apart."""
        if camera not in self._rooms:
            self._rooms[camera] = Backdrop(self._draw_geoms(self._room, camera), self._offscreen)
        if camera not in self._backdrops and self._is_behind_wall(camera):
            self._backdrops[camera] = None
        if camera not in self._backdrops:
            sleepers = self._draw_geoms(self._asleep, camera)
            self._backdrops[camera] = self._rooms[camera].behind(sleepers)
        return self._backdrops[camera]

    def _draw_geoms(self, geoms: Geoms, camera: int) -> Pixels:
        self._list(self._others, geoms, self._no_sites)
        return self._offscreen.draw(self._others, self._data, camera)

    def _list(self, scene: mujoco.MjvScene, geoms: Geoms, options: mujoco.MjvOption) -> None:
        """Fill a scene with the visual ones of some geoms, and with the sites that the options show."""
        with self._shown(geoms):
            mujoco.mjv_updateScene(self._model, self._data, options, None, self._eye, ALL, scene)

    @contextlib.contextmanager
    def _shown(self, geoms: Geoms) -> Iterator[None]:
        """Hide all other geoms in the `with` block by giving them a group that is not drawn."""
        groups = self._model.geom_group
        kept = groups.copy()
        groups[~geoms] = HIDDEN_GROUP
        try:
            yield
        finally:
            groups[:] = kept

    def _looks(self, geoms: Geoms) -> bytes:
        """Poses and colours of geoms: all that a scene may change of them."""
        data, model = self._data, self._model
        fields = (data.geom_xpos, data.geom_xmat, model.geom_rgba)
        return b"".join(field[geoms].tobytes() for field in fields)

    def _can_composite_by_depth(self) -> bool:
        """Whether no geom is translucent or reflective, and neither shadows nor anti-aliasing are drawn."""
        model, quality = self._model, self._offscreen.quality
        alpha = np.concatenate([model.geom_rgba[:, 3], model.mat_rgba[:, 3]])
        is_opaque = ((alpha == 0) | (alpha == 1)).all() and not model.mat_reflectance.any()
        return bool(is_opaque and quality.samples == 0 and quality.shadow_map_size == 0)

    def _is_behind_wall(self, camera: int) -> bool:
        """Whether a camera is behind a plane, which MuJoCo draws translucent from there."""
        to_camera = self._data.cam_xpos[camera] - self._data.geom_xpos[self._planes]
        return bool(((to_camera * self._data.geom_xmat[self._planes, 2::3]).sum(axis=1) < 0).any())


class Backdrop:
    """An image that others can be laid over.

    Attributes:
        rgb: as in `Pixels`.
        nearness: as in `Pixels`.
        depth_m: (height, width) float32, metres along the optical axis.
    """

    def __init__(self, pixels: Pixels, offscreen: Offscreen):
        self.rgb, self.nearness = pixels
        self.depth_m = offscreen.depth_m(offscreen.centres(pixels.nearness))
        self._offscreen = offscreen

    def behind(self, front: Pixels) -> Backdrop | None:
        """A new image of this one with the geoms of `front` laid over it, bit for bit as if all were drawn at once.

        The depth test keeps the nearest geom at each pixel, in any drawing order. The result is None if geoms of both are
        exactly equally near at some pixel, since the drawing order then counts.
        """
        is_front = front.nearness > self.nearness
        if np.any((front.nearness == self.nearness) & (front.nearness > 0)):
            return None
        both = copy.copy(self)
        both.nearness = np.maximum(front.nearness, self.nearness)
        both.rgb, both.depth_m = self.rgb.copy(), self.depth_m.copy()
        np.copyto(_whole_pixels(both.rgb), _whole_pixels(front.rgb), where=is_front)
        centres = self._offscreen.centres(is_front)
        both.depth_m[centres] = self._offscreen.depth_m(self._offscreen.centres(front.nearness)[centres])
        return both


def _whole_pixels(rgb: NDArray[np.uint8]) -> NDArray[np.void]:
    """A view (height, width) of an image, which NumPy copies several times as fast as rows of three bytes."""
    return rgb.view("V3")[..., 0]
