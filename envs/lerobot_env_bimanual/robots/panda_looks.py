"""How a Panda looks: white shells, dark lids on its joints, the wide hand and its tapering fingers.

The shells are seen and nothing else; what collides are the plain shapes of `panda.py`, out of which they stand by 20 mm
at most. Each is the convex hull of a few drums, which blends a joint's housing into the tube of its link as the real
covers do: light meshes of our own making, drawn by eye.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY

FACETS = 20
"""Facets around a drum; its rims are rounded by one ring each."""

type Point = tuple[float, float, float]

WHITE = (0.93, 0.94, 0.95, 1.0)
DARK = (0.20, 0.21, 0.23, 1.0)
GREY = (0.62, 0.64, 0.66, 1.0)


@dataclass(frozen=True)
class Drum:
    """A cylinder with bevelled rims, in the frame of a body.

    Attributes:
        start: (3,) middle of one end, m.
        end: (3,) middle of the other end, m.
        radius: m.
        bevel: of the rims, m.
        facets: sides.
    """

    start: Point
    end: Point
    radius: float
    bevel: float = 0.012
    facets: int = FACETS

    def points(self) -> NDArray[np.float64]:
        """(4 * facets, 3) the corners of its rims."""
        start, end = np.array(self.start), np.array(self.end)
        axis = (end - start) / np.linalg.norm(end - start)
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        angles = (np.arange(self.facets) + 0.5) * 2 * np.pi / self.facets
        ring = np.outer(np.cos(angles), across) + np.outer(np.sin(angles), np.cross(axis, across))
        inset = self.bevel * axis
        return np.concatenate(
            [
                start + (self.radius - self.bevel) * ring,
                start + inset + self.radius * ring,
                end - inset + self.radius * ring,
                end + (self.radius - self.bevel) * ring,
            ]
        )


@dataclass(frozen=True)
class Shell:
    """The convex hull of drums, in one colour."""

    drums: tuple[Drum, ...]
    rgba: tuple[float, float, float, float] = WHITE


def _lids(start: Point, end: Point, radius: float) -> Shell:
    """Dark lids that stand out of both ends of a housing: one drum through it."""
    return Shell((Drum(start, end, radius, bevel=0.004),), DARK)


def _slab(
    x: float, y: float, z: tuple[float, float], rounding: float, shift_x: float = 0.0
) -> tuple[Drum, ...]:
    """Upright drums in the corners of a block of half sizes x and y between two heights."""
    return tuple(
        Drum(
            (shift_x + u, v, z[0]), (shift_x + u, v, z[1]), rounding, bevel=min(0.003, rounding / 2), facets=8
        )
        for u in (-x + rounding, x - rounding)
        for v in (-y + rounding, y - rounding)
    )


BASE = (
    Shell(_slab(0.100, 0.085, (0.0, 0.014), 0.020, shift_x=-0.055), GREY),
    Shell(
        (
            Drum((0, 0, 0.012), (0, 0, 0.140), 0.068),
            *_slab(0.055, 0.050, (0.012, 0.075), 0.018, shift_x=-0.085),
        )
    ),
)
LINKS = (
    (
        Shell((Drum((0, 0, -0.193), (0, 0, -0.120), 0.062), Drum((0, -0.060, 0), (0, 0.060, 0), 0.063))),
        _lids((0, -0.064, 0), (0, 0.064, 0), 0.053),
    ),
    (Shell((Drum((0, 0, -0.057), (0, 0, 0.057), 0.060), Drum((0, -0.130, 0), (0, -0.193, 0), 0.059))),),
    (
        Shell(
            (
                Drum((0, 0, -0.122), (0, 0, -0.070), 0.058),
                Drum((0.0825, -0.053, 0), (0.0825, 0.053, 0), 0.056),
            )
        ),
        _lids((0.0825, -0.058, 0), (0.0825, 0.058, 0), 0.047),
    ),
    (
        Shell(
            (
                Drum((0, 0, -0.052), (0, 0, 0.052), 0.054),
                Drum((-0.0825, 0.070, 0), (-0.0825, 0.122, 0), 0.056),
            )
        ),
    ),
    (
        Shell(
            (Drum((0, 0, -0.261), (0, 0, -0.215), 0.057), Drum((0, 0.062, -0.150), (0, 0.066, -0.130), 0.035))
        ),
        Shell(
            (
                Drum((0, 0.062, -0.170), (0, 0.066, -0.140), 0.035),
                Drum((0, 0.066, -0.090), (0, 0.068, -0.065), 0.033),
                Drum((0, 0.010, 0), (0, 0.064, 0), 0.044),
            )
        ),
        Shell((Drum((0, -0.040, 0), (0, 0.050, 0), 0.045),)),
        _lids((0, -0.044, 0), (0, 0.069, 0), 0.037),
    ),
    (
        Shell(
            (Drum((0, 0, -0.045), (0, 0, 0.030), 0.046), Drum((0.088, -0.035, 0), (0.088, 0.050, 0), 0.045))
        ),
    ),
    (
        Shell((Drum((0, 0, -0.040), (0, 0, 0.088), 0.043),)),
        Shell((Drum((0, 0, 0.084), (0, 0, 0.108), 0.034, bevel=0.003),), DARK),
    ),
)
HAND = (
    Shell((*_slab(0.027, 0.074, (0.002, 0.020), 0.016), *_slab(0.0315, 0.102, (0.024, 0.060), 0.016))),
    Shell(_slab(0.022, 0.096, (0.054, 0.0668), 0.005), DARK),
)
FINGER = (
    Shell(
        (
            *(Drum((x, 0.0145, 0.000), (x, 0.0145, 0.022), 0.0065, 0.001, 6) for x in (-0.004, 0.004)),
            *(Drum((x, 0.0090, 0.030), (x, 0.0090, 0.047), 0.0045, 0.001, 6) for x in (-0.004, 0.004)),
        ),
        GREY,
    ),
)


def add_looks(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, shells: Sequence[Shell]) -> None:
    """Dress a body; bodies that look alike share the meshes.

    Args:
        spec: the model under construction.
        body: what to dress.
        name: of the looks, e.g. "panda_link1".
        shells: of `BASE`, `LINKS`, `HAND` or `FINGER`.
    """
    for number, shell in enumerate(shells):
        mesh = f"{name}_{number}"
        if spec.mesh(mesh) is None:
            points = np.concatenate([drum.points() for drum in shell.drums])
            # Without faces MuJoCo takes the hull.
            spec.add_mesh(
                name=mesh, uservert=points.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
            )
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh, rgba=shell.rgba, **VISUAL_ONLY)
