"""The camera that shows most of an episode, and the part of its view that the episode is in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations import matrix_to_quat_wxyz
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS
from lerobot_env_bimanual.world.scene import Scene, SceneState

RAYS = (48, 64)
"""Rows and columns of rays that stand for an image."""
MOVED_M = 0.002
"""Way along an axis from which on an object counts as moved: less than that of a button."""
ROOM_M = 0.16
"""Around hands and things that a frame leaves."""
DRAWN_GROUPS = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)
"""Groups of geoms that MuJoCo draws; the others only collide."""

type Frame = dict[str, NDArray[np.float64]]
"""Fields of a model that turn and zoom a camera, as `Appearance` wears them."""


def clearest_camera(scene: Scene, states: Sequence[SceneState]) -> str:
    """The fixed camera that shows most of the objects that an episode moves, and of the hands.

    Each has one vote, split in proportion to how much of it, in m2, each camera sees; so a small thing counts as much as
    a large one, a camera's zoom does not count, and nothing counts for a camera that does not see it.

    Args:
        scene: the scene; it is left in the last state.
        states: moments of the episode.
    """
    model, data = scene.model, scene.data
    objects = _objects(scene)
    seen = np.zeros((len(FIXED_CAMERAS), model.ntree))
    places_m = np.empty((len(states), model.nbody, 3))
    for state, places in zip(states, places_m, strict=True):
        scene.restore_state(state)
        places[:] = data.xipos
        for row, camera in zip(seen, FIXED_CAMERAS, strict=True):
            geoms, areas_m2 = _first_geoms(scene, camera.name)
            trees = objects[geoms]
            row += np.bincount(trees[trees >= 0], areas_m2[trees >= 0], minlength=len(row))
    moved = np.unique(model.body_treeid[_moved(places_m)])
    votes = (seen / np.maximum(seen.sum(axis=0), 1))[:, moved]
    return FIXED_CAMERAS[int(votes.sum(axis=1).argmax())].name


def frame_of(scene: Scene, camera: str, states: Sequence[SceneState], size: tuple[int, int]) -> Frame:
    """Turn and zoom of a fixed camera with which it shows hands and moved objects as large as the image allows.

    Args:
        scene: the scene; it is left in the last state.
        camera: name of the camera, which is left where it is.
        states: moments of the episode, from its start on.
        size: height and width of the image, pixels.
    """
    model, index = scene.model, scene.model.camera(camera).id
    places_m = np.empty((len(states), model.nbody, 3))
    for state, places in zip(states, places_m, strict=True):
        scene.restore_state(state)
        places[:] = scene.data.xipos
    is_arm = np.any([scene.bodies(scene.arm_pair.base_body(arm)) for arm in ARMS], axis=0)
    is_hand = np.any([scene.bodies(scene.arm_pair.hand_body(arm)) for arm in ARMS], axis=0)
    # The hands come from far above.
    things_m, hands_m = places_m[:, _moved(places_m) & ~is_arm], places_m[1:, is_hand]
    points_m = np.concatenate([things_m.reshape(-1, 3), hands_m.reshape(-1, 3)])
    eye, half = scene.data.cam_xpos[index], np.tan(np.deg2rad(model.cam_fovy[index]) / 2)
    axes, sides = scene.data.cam_xmat[index].reshape(3, 3), []
    for _ in range(3):  # where the middle of what is seen moves to the middle of the image
        right, up, back = ((points_m - eye) @ axes).T
        room = ROOM_M / -back
        sides = [(np.min(way / -back - room), np.max(way / -back + room)) for way in (right, up)]
        axes = _towards(axes @ np.array([*np.mean(sides, axis=1), -1.0]))
    wide, high = np.ptp(sides, axis=1) / 2
    fovy, quat_wxyz = model.cam_fovy.copy(), model.cam_quat.copy()
    fovy[index] = 2 * np.rad2deg(np.arctan(min(half, max(high, wide * size[0] / size[1]))))
    quat_wxyz[index] = matrix_to_quat_wxyz(axes)
    return {"cam_fovy": fovy, "cam_quat": quat_wxyz}


def _towards(ahead: NDArray) -> NDArray:
    """(3, 3) axes of a camera, in MuJoCo's order, that looks in a direction with its right side level."""
    back = -ahead / np.linalg.norm(ahead)
    right = np.cross((0, 0, 1), back)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(back, right), back])


def _moved(places_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(nbody,) bodies that are not always in one place, from their places (n, nbody, 3)."""
    return np.ptp(places_m, axis=0).max(axis=1) > MOVED_M


def _objects(scene: Scene) -> NDArray[np.int_]:
    """(ngeom + 1,) the object, a kinematic tree, of each geom; -1 of links, of what cannot move, of nothing."""
    trees = np.append(scene.model.body_treeid[scene.model.geom_bodyid], -1)
    for arm in ARMS:
        pair = scene.arm_pair
        trees[:-1][scene.geoms(pair.base_body(arm)) & ~scene.geoms(pair.hand_body(arm))] = -1
    return trees


def _first_geoms(scene: Scene, camera: str) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """The geom that each ray of a camera meets first, -1 for none, and the area that the ray stands for there, m2."""
    model, data = scene.model, scene.data
    index = model.camera(camera).id
    rows, columns = RAYS
    half_height = np.tan(np.deg2rad(model.cam_fovy[index]) / 2)
    y = half_height * (1 - (2 * np.arange(rows) + 1) / rows)
    x = half_height * ((2 * np.arange(columns) + 1) - columns) / rows
    grid_x, grid_y = np.meshgrid(x, y)
    rays = np.stack([grid_x, grid_y, -np.ones_like(grid_x)], axis=-1).reshape(-1, 3)
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ data.cam_xmat[index].reshape(3, 3).T
    geoms, distances = np.empty(len(rays), np.int32), np.empty(len(rays))
    mujoco.mj_multiRay(
        model,
        data,
        data.cam_xpos[index],
        rays.ravel(),
        DRAWN_GROUPS,
        1,
        -1,
        geoms,
        distances,
        None,
        len(rays),
        model.vis.map.zfar * model.stat.extent,
    )
    return geoms, np.square(2 * half_height / rows * distances)
