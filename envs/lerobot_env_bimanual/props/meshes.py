"""Closed meshes: round things turned from a profile, and flat things with rounded corners."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY

SEGMENTS = 48
CORNER_SEGMENTS = 8

type Mesh = tuple[NDArray[np.float64], NDArray[np.int32]]
"""Vertices (n, 3) in metres and faces (m, 3), counter-clockwise seen from outside."""


def add_mesh(spec: mujoco.MjSpec, name: str, mesh: Mesh, **settings: Any) -> None:
    """Add a mesh asset to a model under construction; `settings` are those of MuJoCo's meshes."""
    vertices, faces = mesh
    spec.add_mesh(name=name, uservert=vertices.ravel(), userface=faces.ravel(), **settings)


def add_visual_mesh(body: mujoco.MjsBody, mesh: str, **settings: Any) -> None:
    """Add a mesh, by its name, that is seen but neither touches nor weighs anything."""
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, **VISUAL_ONLY | settings)


def lathe(profile: Sequence[tuple[float, float]]) -> Mesh:
    """A closed body of revolution about the z axis.

    Args:
        profile: radius and height of the outline in metres, from the axis along the outside back to the axis:
            with the axis to the left of the drawing, counter-clockwise. The first and the last radius are 0.
    """
    radii, heights = np.array(profile[1:-1]).T
    angles = np.arange(SEGMENTS) * 2 * np.pi / SEGMENTS
    rings = np.empty((len(radii), SEGMENTS, 3))
    rings[..., 0] = radii[:, None] * np.cos(angles)
    rings[..., 1] = radii[:, None] * np.sin(angles)
    rings[..., 2] = heights[:, None]
    return closed(rings, (0.0, 0.0, profile[0][1]), (0.0, 0.0, profile[-1][1]))


def slab(half_size_m: ArrayLike, radius_m: float) -> Mesh:
    """A box with rounded upright edges.

    One mesh instead of boxes and cylinders: where coplanar faces overlap, the renderer lights them twice.

    Args:
        half_size_m: (3,) half sizes of the box around it; it is centred at the origin.
        radius_m: of the upright edges, at most the smaller horizontal half size.
    """
    x, y, z = np.asarray(half_size_m, dtype=np.float64)
    outline = []
    for turn, center in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angles = np.linspace(turn, turn + 1, CORNER_SEGMENTS + 1) * np.pi / 2
        arc = np.column_stack([np.cos(angles), np.sin(angles)])
        outline.append(radius_m * arc + np.multiply(center, (x - radius_m, y - radius_m)))
    ring = np.concatenate(outline)  # (n, 2), counter-clockwise
    rings = np.stack([np.insert(ring, 2, height, axis=1) for height in (-z, z)])
    return closed(rings, (0.0, 0.0, -z), (0.0, 0.0, z))


def closed(
    rings: NDArray[np.float64], first: Sequence[float] | NDArray, last: Sequence[float] | NDArray
) -> Mesh:
    """Skin over rings (r, n, 3) of corners, and over two points (3,) that close the first and the last ring."""
    count = rings.shape[1]
    vertices = np.concatenate([rings.reshape(-1, 3), np.stack([first, last])])
    pole, last_ring = len(vertices) - 2, (len(rings) - 1) * count
    here = np.arange(count)
    onwards = (here + 1) % count
    faces = [
        np.column_stack([np.full(count, pole), onwards, here]),
        np.column_stack([np.full(count, pole + 1), last_ring + here, last_ring + onwards]),
    ]
    for ring in range(0, last_ring, count):
        a, b, c, d = ring + here, ring + onwards, ring + count + here, ring + count + onwards
        faces += [np.column_stack([a, b, d]), np.column_stack([a, d, c])]
    return vertices, np.concatenate(faces).astype(np.int32)
