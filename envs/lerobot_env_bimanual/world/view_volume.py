"""Which geoms a camera can see at all, and which reach the room's planes."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco

MARGIN_M = 0.001
"""Far more than what rounding moves a drawn vertex by."""


def in_view(model: mujoco.MjModel, data: mujoco.MjData, camera: int, aspect: float) -> NDArray[np.bool_]:
    """(ngeom,) whether a geom may reach into the image: its bounding sphere does, or it has none.

    Args:
        model: of the scene.
        data: its state.
        camera: its number.
        aspect: width of the image over its height.
    """
    half_height = np.tan(np.deg2rad(model.cam_fovy[camera]) / 2)
    half_width = aspect * half_height
    outward = np.array([[1, 0, half_width], [-1, 0, half_width], [0, 1, half_height], [0, -1, half_height]])
    outward /= np.linalg.norm(
        outward, axis=1, keepdims=True
    )  # of the image's sides, in MuJoCo's camera frame
    to_geom = data.geom_xpos - data.cam_xpos[camera]
    beyond_m = (to_geom @ (data.cam_xmat[camera].reshape(3, 3) @ outward.T)).max(axis=1)
    radius_m = model.geom_rbound
    return (radius_m == 0) | (beyond_m < radius_m + MARGIN_M)


def reach_planes(model: mujoco.MjModel, data: mujoco.MjData, planes: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(ngeom,) whether the bounding box of a geom touches or crosses one of the planes, or is behind it.

    Args:
        model: of the scene.
        data: its state.
        planes: (ngeom,) which geoms they are; here they have no end.
    """
    frames = data.geom_xmat.reshape(-1, 3, 3)
    middles = data.geom_xpos + (frames @ model.geom_aabb[:, :3, None])[..., 0]
    normals = data.geom_xmat[planes, 2::3]
    above_m = middles @ normals.T - (data.geom_xpos[planes] * normals).sum(axis=1)  # (ngeom, planes)
    half_m = (np.abs(normals @ frames) @ model.geom_aabb[:, 3:, None])[..., 0]
    return (above_m - half_m < MARGIN_M).any(axis=1)
