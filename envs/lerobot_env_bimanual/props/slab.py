"""Meshes of flat things with rounded corners."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_env_bimanual.gl import mujoco

CORNER_SEGMENTS = 8


def add_slab(spec: mujoco.MjSpec, name: str, half_size_m: ArrayLike, radius_m: float) -> None:
    """Add a mesh asset that is a box with rounded upright edges.

    One mesh instead of boxes and cylinders: where coplanar faces overlap, the renderer lights them twice.

    Args:
        spec: the model under construction.
        name: of the mesh.
        half_size_m: (3,) half sizes of the box around it; it is centred at the origin.
        radius_m: of the upright edges, at most the smaller horizontal half size.
    """
    vertices, faces = slab(half_size_m, radius_m)
    spec.add_mesh(name=name, uservert=vertices.ravel(), userface=faces.ravel())


def slab(half_size_m: ArrayLike, radius_m: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices (n, 3) in metres and faces (m, 3), counter-clockwise seen from outside; see `add_slab`."""
    x, y, z = np.asarray(half_size_m, dtype=np.float64)
    angles = np.linspace(0, np.pi / 2, CORNER_SEGMENTS + 1)
    quarter = radius_m * np.column_stack([np.cos(angles), np.sin(angles)])
    corner = (x - radius_m, y - radius_m)
    outline = []
    for turn, side_x, side_y in ((0, 1, 1), (1, -1, 1), (2, -1, -1), (3, 1, -1)):
        cos, sin = round(np.cos(turn * np.pi / 2)), round(np.sin(turn * np.pi / 2))
        rotated = quarter @ np.array([[cos, sin], [-sin, cos]])
        outline.append(rotated + (side_x * corner[0], side_y * corner[1]))
    bottom = np.concatenate(outline)  # (n, 2), counter-clockwise
    count = len(bottom)
    vertices = np.concatenate(
        [np.column_stack([bottom, np.full(count, side * z)]) for side in (-1, 1)] + [[(0, 0, -z), (0, 0, z)]]
    )
    here = np.arange(count)
    onwards = (here + 1) % count
    faces = [
        np.column_stack([np.full(count, 2 * count), onwards, here]),
        np.column_stack([np.full(count, 2 * count + 1), count + here, count + onwards]),
        np.column_stack([here, onwards, count + onwards]),
        np.column_stack([here, count + onwards, count + here]),
    ]
    return vertices, np.concatenate(faces).astype(np.int32)
