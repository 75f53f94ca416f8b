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
    outline = []
    for turn, center in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angles = np.linspace(turn, turn + 1, CORNER_SEGMENTS + 1) * np.pi / 2
        arc = np.column_stack([np.cos(angles), np.sin(angles)])
        outline.append(radius_m * arc + np.multiply(center, (x - radius_m, y - radius_m)))
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
