"""Pinhole geometry.

Camera frames follow OpenCV: x right, y down, z forward. Pixel (row i, column j) has its centre at image
coordinates (j + 0.5, i + 0.5).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def intrinsics_from_fovy(fovy_rad: float, height: int, width: int) -> NDArray[np.float64]:
    """Pinhole matrix (3, 3) in pixels of a camera with square pixels and a vertical field of view."""
    focal = 0.5 * height / math.tan(fovy_rad / 2)
    return np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])


def unproject(depth_m: ArrayLike, intrinsics: ArrayLike, world_T_camera: ArrayLike) -> NDArray[np.float64]:
    """World points of a depth image.

    Args:
        depth_m: (h, w) metres along the optical axis; 0, negative or non-finite where invalid.
        intrinsics: (3, 3) pinhole matrix in pixels.
        world_T_camera: (4, 4), OpenCV axes.

    Returns:
        (h, w, 3) metres in the world frame, NaN where the depth is invalid.
    """
    depth = np.asarray(depth_m, dtype=np.float64)
    height, width = depth.shape
    (fx, _, cx), (_, fy, cy), _ = np.asarray(intrinsics, dtype=np.float64)
    ray_x = (np.arange(width) + 0.5 - cx) / fx
    ray_y = (np.arange(height) + 0.5 - cy) / fy
    depth = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan)
    camera_points = np.stack([depth * ray_x[None, :], depth * ray_y[:, None], depth], axis=-1)  # (h, w, 3)
    transform = np.asarray(world_T_camera, dtype=np.float64)
    return camera_points @ transform[:3, :3].T + transform[:3, 3]


def project(points: ArrayLike, intrinsics: ArrayLike, world_T_camera: ArrayLike) -> NDArray[np.float64]:
    """Image coordinates (..., 2) in pixels (x right, y down) and depth (..., 1) of world points (..., 3)."""
    transform = np.asarray(world_T_camera, dtype=np.float64)
    camera_points = (np.asarray(points, dtype=np.float64) - transform[:3, 3]) @ transform[:3, :3]
    pixels = camera_points @ np.asarray(intrinsics, dtype=np.float64).T
    return np.concatenate([pixels[..., :2] / pixels[..., 2:], camera_points[..., 2:]], axis=-1)
