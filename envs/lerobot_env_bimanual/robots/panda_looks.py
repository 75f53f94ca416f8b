"""How a Panda looks: waisted white shells, dark lids on its elbow and wrist, the wide hand and its tapering fingers.

The shells are visual only. Collisions use the plain shapes of `panda.toml`, from which the shells protrude by 20 mm at
most. Each shell is a rounded outline swept along an arc: a joint's housing is a drum, and the tube of its link narrows
between two drums, as the real covers do.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.meshes import Mesh, add_mesh, add_visual_mesh, closed
from lerobot_env_bimanual.props.prop import COARSE, FINE

type Point = tuple[float, float, float]
type Section = tuple[float, float, float]
"""Share of the way along an arc, and the half sizes there in m: in the plane in which the arc bends, and across it."""

DARK = (0.13, 0.14, 0.16, 1.0)
COLORS = {"white": (0.93, 0.94, 0.95, 1.0), "dark": DARK, "grey": (0.60, 0.62, 0.64, 1.0)}


@dataclass(frozen=True)
class Shell:
    """A rounded outline, swept along an arc, in the frame of a body; `panda_looks.toml` says what its numbers mean."""

    arc: tuple[Point, Point, Point]
    sections: tuple[Section, ...]
    rgba: tuple[float, float, float, float]
    across: Point = (0, 1, 0)
    bevel: float = 0.008
    power: float = 2.0
    sides: int = 24

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


def _shell(
    color: str = "white",
    axis: Sequence[Point] = (),
    radius: float = 0,
    end_radius: float | None = None,
    **fields: Any,
) -> Shell:
    """A shell from an entry of `panda_looks.toml`; with `axis`, a round one along an axis of the body."""
    if axis:
        start, end = axis
        end_radius = radius if end_radius is None else end_radius
        fields["arc"] = (start, np.add(start, end) / 2, end)
        fields["sections"] = ((0, radius, radius), (1, end_radius, end_radius))
        fields["across"] = np.eye(3)[(np.argmax(np.abs(np.subtract(end, start))) + 1) % 3]
    return Shell(rgba=COLORS[color], **fields)


_ROWS = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
type Shells = tuple[Shell, ...]
LOOKS: Mapping[str, Shells] = {body: tuple(_shell(**row) for row in rows) for body, rows in _ROWS.items()}
"""Shells by body: `base`, `link1` to `link7`, `hand` and `finger`."""


def add_looks(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str) -> None:
    """Add the shells `LOOKS[name]` to a body as visual meshes, fine and coarse; bodies with the same `name` share them."""
    shells = LOOKS[name]
    for number, rgba in enumerate(dict.fromkeys(shell.rgba for shell in shells)):
        for group in (COARSE, FINE):
            mesh = f"panda_{name}_{number}_{group}"  # of all shells of one colour
            if spec.mesh(mesh) is None:
                parts = [shell.mesh(group == FINE) for shell in shells if shell.rgba == rgba]
                firsts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
                vertices = np.concatenate([each for each, _ in parts])
                faces = np.concatenate(
                    [each + first for (_, each), first in zip(parts, firsts, strict=False)]
                )
                add_mesh(spec, mesh, (vertices, faces), smoothnormal=True)
            add_visual_mesh(body, mesh, rgba=rgba, group=group)
