"""Meshes of round things, turned from a profile."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco

SEGMENTS = 48


def add_lathe(spec: mujoco.MjSpec, name: str, profile: Sequence[tuple[float, float]]) -> None:
    """Add a mesh asset that is the body of revolution of a profile about the z axis.

    Args:
        spec: the model under construction.
        name: of the mesh.
        profile: see `lathe`.
    """
    vertices, faces = lathe(profile)
    spec.add_mesh(name=name, uservert=vertices.ravel(), userface=faces.ravel())


def lathe(
    profile: Sequence[tuple[float, float]], segments: int = SEGMENTS
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices and outward triangles of a closed body of revolution about the z axis.

    Args:
        profile: radius and height of the outline in metres, from the axis along the outside back to the axis:
            with the axis to the left of the drawing, counter-clockwise. The first and the last radius are 0.
        segments: sides of the body.

    Returns:
        Vertices (n, 3) in metres and faces (m, 3), counter-clockwise seen from outside.
    """
    radii, heights = np.array(profile[1:-1]).T
    angles = np.arange(segments) * 2 * np.pi / segments
    rings = np.empty((len(radii), segments, 3))
    rings[..., 0] = radii[:, None] * np.cos(angles)
    rings[..., 1] = radii[:, None] * np.sin(angles)
    rings[..., 2] = heights[:, None]
    poles = [(0.0, 0.0, profile[0][1]), (0.0, 0.0, profile[-1][1])]
    vertices = np.concatenate([rings.reshape(-1, 3), poles])

    first = len(vertices) - 2
    here = np.arange(segments)
    onwards = (here + 1) % segments
    last_ring = (len(radii) - 1) * segments
    faces = [
        np.column_stack([np.full(segments, first), onwards, here]),
        np.column_stack([np.full(segments, first + 1), last_ring + here, last_ring + onwards]),
    ]
    for ring in range(0, last_ring, segments):
        a, b, c, d = ring + here, ring + onwards, ring + segments + here, ring + segments + onwards
        faces += [np.column_stack([a, b, d]), np.column_stack([a, d, c])]
    return vertices, np.concatenate(faces).astype(np.int32)
