"""The camera that shows most of an episode."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.cameras import FIXED_CAMERAS
from lerobot_env_bimanual.world.scene import Scene, SceneState

RAYS = (48, 64)
"""Rows and columns of rays that stand for an image."""
MOVED_M = 0.002
"""Way along an axis from which on an object counts as moved: less than that of a button."""
DRAWN_GROUPS = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)
"""Groups of geoms that MuJoCo draws; the others only collide."""


def clearest_camera(scene: Scene, states: Sequence[SceneState]) -> str:
    """The fixed camera that shows most of the objects that an episode moves.

    Each object has one vote, split in proportion to the rays of each camera that meet it first; so a small thing
    counts as much as a large one, and one that a camera does not see does not count for it.

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
            trees = objects[_first_geoms(scene, camera.name)]
            row += np.bincount(trees[trees >= 0], minlength=len(row))
    moved_bodies = np.ptp(places_m, axis=0).max(axis=1) > MOVED_M
    moved = np.unique(model.body_treeid[moved_bodies])
    votes = (seen / np.maximum(seen.sum(axis=0), 1))[:, moved]
    return FIXED_CAMERAS[int(votes.sum(axis=1).argmax())].name


def _objects(scene: Scene) -> NDArray[np.int_]:
    """(ngeom + 1,) the movable object, a kinematic tree, of each geom; -1 of arms, of what cannot move, of nothing."""
    trees = np.append(scene.model.body_treeid[scene.model.geom_bodyid], -1)
    for arm in ARMS:
        trees[:-1][scene.geoms(scene.arm_pair.base_body(arm))] = -1
    return trees


def _first_geoms(scene: Scene, camera: str) -> NDArray[np.int32]:
    """The geom that each ray of a camera meets first, -1 for none."""
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
    return geoms
