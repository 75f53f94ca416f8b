"""How a Panda looks: waisted white shells, dark lids on its elbow and wrist, the wide hand and its tapering fingers.

The shells are seen and nothing else; what collides are the plain shapes of `panda.py`, out of which they stand by 20 mm
at most. Each is a rounded outline swept along an arc: a joint's housing is a drum, and the tube of its link narrows between
two of them, as the real covers do. Sizes are our own, drawn by eye.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.meshes import Mesh, closed, draw_mesh

type Point = tuple[float, float, float]
type Section = tuple[float, float, float]
"""Share of the way along an arc, and the half sizes there in m: in the plane in which the arc bends, and across it."""

WHITE = (0.93, 0.94, 0.95, 1.0)
DARK = (0.13, 0.14, 0.16, 1.0)
GREY = (0.60, 0.62, 0.64, 1.0)

COARSE, FINE = 1, 4
"""Groups of the geoms of coarse looks, which MuJoCo draws unless told otherwise, and of fine ones for large pictures."""


@dataclass(frozen=True)
class Shell:
    """A rounded outline, swept along an arc, in the frame of a body.

    Attributes:
        arc: start, the point towards which it starts, and end, m.
        sections: at least two, from the start to the end; between them sizes follow straight lines.
        across: axis across the plane in which the arc bends.
        bevel: rounding of the rims at both ends, m.
        power: 2 is a round outline; the larger, the squarer.
        sides: of the outline.
        rgba: colour.
    """

    arc: tuple[Point, Point, Point]
    sections: tuple[Section, ...]
    across: Point = (0, 1, 0)
    bevel: float = 0.008
    power: float = 2.0
    sides: int = 24
    rgba: tuple[float, float, float, float] = WHITE

    def mesh(self, fine: bool) -> Mesh:
        """Its closed surface, fine for pictures or coarse for small images."""
        start, middle, end = np.array(self.arc, float)
        rim = self.bevel / np.linalg.norm(end - start)
        rounds = np.linspace(0, np.pi / 2, 3) if fine else np.array([np.pi / 4])  # along a rim
        into, inset = 1 - np.cos(rounds), self.bevel * (1 - np.sin(rounds))
        shares, *sizes = np.array(self.sections).T
        inner = shares[(shares > rim) & (shares < 1 - rim)]
        share = np.concatenate([rim * into, inner, 1 - rim * into[::-1]])
        less = np.concatenate([inset, np.zeros(len(inner)), inset[::-1]])
        half = [np.interp(share, shares, size) - less for size in sizes]
        share = share[:, None]
        middles = (1 - share) ** 2 * start + 2 * share * (1 - share) * middle + share**2 * end
        ahead = (1 - share) * (middle - start) + share * (end - middle)
        across = np.array(self.across, float)
        within = np.cross(across, ahead / np.linalg.norm(ahead, axis=1, keepdims=True))
        sides = self.sides if fine else self.sides * 5 // 12
        angles = (np.arange(sides) + 0.5) * 2 * np.pi / sides
        u, v = (np.sign(wave) * np.abs(wave) ** (2 / self.power) for wave in (np.cos(angles), np.sin(angles)))
        outline = (
            half[0][:, None, None] * u[:, None] * within[:, None]
            + half[1][:, None, None] * v[:, None] * across
        )
        return closed(middles[:, None] + outline, middles[0], middles[-1])


def _drum(
    start: Point, end: Point, radius: float, end_radius: float = 0, bevel: float = 0.008, rgba=WHITE
) -> Shell:
    """A round shell with a straight axis that is one of the body's."""
    axis = np.subtract(end, start)
    across = tuple(np.eye(3)[(np.argmax(np.abs(axis)) + 1) % 3])
    middle = tuple(np.add(start, end) / 2)
    end_radius = end_radius or radius
    return Shell(
        (start, middle, end), ((0, radius, radius), (1, end_radius, end_radius)), across, bevel, rgba=rgba
    )


def _dark(start: Point, end: Point, radius: float) -> Shell:
    """Dark lids at both ends of a housing, or the gap between two covers: a drum that is a little longer or thinner."""
    return _drum(start, end, radius, bevel=0.002, rgba=DARK)


X, Y, Z = (1, 0, 0), (0, 1, 0), (0, 0, 1)

BASE = (
    Shell(
        ((0, 0, 0.004), (0, 0, 0.07), (0, 0, 0.138)),
        ((0, 0.074, 0.074), (0.25, 0.069, 0.069), (0.6, 0.060, 0.060), (1, 0.058, 0.058)),
        sides=32,
    ),
    Shell(
        ((-0.146, 0, 0.034), (-0.08, 0, 0.038), (0.0, 0, 0.056)),
        ((0, 0.028, 0.054), (0.45, 0.034, 0.062), (1, 0.050, 0.062)),
        bevel=0.014,
        power=3.5,
    ),
    Shell(
        ((-0.052, 0, 0), (-0.052, 0, 0.006), (-0.052, 0, 0.012)),
        ((0, 0.102, 0.088), (1, 0.102, 0.088)),
        bevel=0.003,
        power=5.0,
        rgba=GREY,
    ),
)
LINKS = (
    (
        Shell(
            ((0, 0, -0.189), (0, 0, -0.1), (0, 0, -0.005)),
            (
                (0, 0.059, 0.059),
                (0.15, 0.057, 0.057),
                (0.40, 0.053, 0.053),
                (0.6, 0.0545, 0.0555),
                (0.8, 0.060, 0.061),
                (1, 0.062, 0.062),
            ),
        ),
        _drum((0, -0.060, 0), (0, 0.060, 0), 0.061, bevel=0.012),
        _dark((0, 0, -0.195), (0, 0, -0.180), 0.054),
    ),
    (
        _drum((0, 0, -0.066), (0, 0, 0.066), 0.050, bevel=0.006),
        Shell(
            ((0, 0.0, 0), (0, -0.1, 0), (0, -0.188, 0)),
            (
                (0, 0.060, 0.055),
                (0.2, 0.059, 0.055),
                (0.4, 0.0545, 0.0545),
                (0.6, 0.053, 0.053),
                (0.85, 0.057, 0.057),
                (1, 0.059, 0.059),
            ),
            Z,
        ),
    ),
    (
        Shell(
            ((0, 0, -0.124), (0, 0, -0.05), (0.0825, 0, 0)),
            (
                (0, 0.059, 0.059),
                (0.2, 0.056, 0.057),
                (0.45, 0.052, 0.054),
                (0.7, 0.053, 0.053),
                (1, 0.056, 0.053),
            ),
        ),
        _drum((0.0825, -0.054, 0), (0.0825, 0.054, 0), 0.057, bevel=0.010),
        _dark((0.0825, -0.058, 0), (0.0825, 0.058, 0), 0.046),
        _dark((0, 0, -0.132), (0, 0, -0.115), 0.053),
    ),
    (
        _drum((0, 0, -0.050), (0, 0, 0.050), 0.053),
        Shell(
            ((0, 0, 0), (-0.070, 0.035, 0), (-0.0825, 0.119, 0)),
            (
                (0, 0.050, 0.048),
                (0.35, 0.046, 0.049),
                (0.6, 0.052, 0.053),
                (0.85, 0.057, 0.057),
                (1, 0.059, 0.059),
            ),
            Z,
        ),
    ),
    (
        Shell(
            ((0, 0, -0.258), (0, 0.048, -0.175), (0, 0.058, -0.01)),
            (
                (0, 0.057, 0.057),
                (0.1, 0.057, 0.057),
                (0.3, 0.050, 0.052),
                (0.5, 0.034, 0.044),
                (0.7, 0.024, 0.038),
                (1, 0.022, 0.036),
            ),
            X,
        ),
        _drum((0, -0.042, 0), (0, 0.066, 0), 0.045, bevel=0.008),
        _dark((0, -0.046, 0), (0, 0.069, 0), 0.036),
        _dark((0, 0, -0.266), (0, 0, -0.250), 0.053),
    ),
    (
        _drum((0, 0, -0.046), (0, 0, 0.034), 0.047, bevel=0.008),
        Shell(((0, 0, 0), (0.05, 0, 0), (0.088, 0.005, 0)), ((0, 0.036, 0.040), (1, 0.040, 0.043)), Z),
        _drum((0.088, -0.030, 0), (0.088, 0.050, 0), 0.047, bevel=0.014),
        _dark((0.088, -0.038, 0), (0.088, -0.020, 0), 0.041),
    ),
    (
        _drum((0, 0, 0.035), (0, 0, 0.090), 0.0445, 0.043),
        Shell(
            ((0.0, 0, 0.070), (0.025, 0, 0.070), (0.055, 0, 0.072)),
            ((0, 0.018, 0.030), (1, 0.016, 0.022)),
            bevel=0.006,
            power=3.0,
        ),
        _dark((0, 0, 0.080), (0, 0, 0.108), 0.036),
    ),
)
HAND = (
    Shell(
        ((0, 0, 0.001), (0, 0, 0.03), (0, 0, 0.062)),
        (
            (0, 0.0305, 0.042),
            (0.18, 0.031, 0.046),
            (0.30, 0.0315, 0.066),
            (0.40, 0.0315, 0.088),
            (0.52, 0.0315, 0.099),
            (0.7, 0.0315, 0.1025),
            (1, 0.0305, 0.1025),
        ),
        bevel=0.005,
        power=3.2,
        sides=40,
    ),
    Shell(
        ((0, 0, 0.056), (0, 0, 0.06), (0, 0, 0.0668)),
        ((0, 0.022, 0.096), (1, 0.022, 0.096)),
        bevel=0.002,
        power=6.0,
        rgba=DARK,
    ),
)
FINGER = (
    Shell(
        ((0, 0.0145, 0.0), (0, 0.0145, 0.01), (0, 0.0145, 0.023)),
        ((0, 0.0105, 0.0075), (1, 0.0105, 0.0070)),
        bevel=0.002,
        power=5.0,
        sides=20,
        rgba=GREY,
    ),
    Shell(
        ((0, 0.0135, 0.018), (0, 0.0125, 0.03), (0, 0.0095, 0.0535)),
        ((0, 0.0098, 0.0060), (1, 0.0090, 0.0042)),
        bevel=0.002,
        power=4.0,
        sides=20,
        rgba=GREY,
    ),
)


def add_looks(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, shells: Sequence[Shell]) -> None:
    """Dress a body, once finely and once coarsely; bodies that look alike share the meshes.

    Args:
        spec: the model under construction.
        body: what to dress.
        name: of the looks, e.g. "panda_link1".
        shells: of `BASE`, `LINKS`, `HAND` or `FINGER`; those of one colour are one mesh.
    """
    for number, rgba in enumerate(dict.fromkeys(shell.rgba for shell in shells)):
        for group in (COARSE, FINE):
            mesh = f"{name}_{number}_{group}"
            if spec.mesh(mesh) is None:
                parts = [shell.mesh(group == FINE) for shell in shells if shell.rgba == rgba]
                firsts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
                faces = [each + first for (_, each), first in zip(parts, firsts, strict=False)]
                spec.add_mesh(
                    name=mesh,
                    uservert=np.concatenate([vertices for vertices, _ in parts]).ravel(),
                    userface=np.concatenate(faces).ravel(),
                    smoothnormal=True,
                )
            draw_mesh(body, mesh, rgba=rgba, group=group)
