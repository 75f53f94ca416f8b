"""A closed laptop computer."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY, add_box, add_cylinder
from lerobot_env_bimanual.props.slab import add_slab

ALUMINIUM = (0.72, 0.74, 0.77, 1.0)
LID_ALUMINIUM = (0.80, 0.82, 0.85, 1.0)
BADGE = (0.30, 0.33, 0.38, 1.0)
DARK = (0.10, 0.10, 0.12, 1.0)
SCREEN = (0.05, 0.06, 0.09, 1.0)

HINGE_INSET_M = 0.0045
HINGE_RANGE_RAD = 1.83
HINGE_FRICTION_NM = 0.05
"""Brake of the hinge, which keeps the lid where it is."""
SEAM_M = 0.0006
CORNER_RADIUS_M = 0.016
SHEET_HALF_THICKNESS_M = 0.0003

HIDDEN_GROUP = 3
MESH = mujoco.mjtGeom.mjGEOM_MESH


@dataclass(frozen=True)
class Laptop:
    """A free laptop whose lid turns about its +y edge. Its frame lies in the middle of the base.

    Attributes:
        name: body; also the lid's (`..._lid`) and the hinge's (`..._hinge`) prefix.
        base_size_m: full sizes of the base (PerAct2 code).
        lid_size_m: full sizes of the lid.
        base_mass_kg: half of the original's 1.35 kg, which sags in a grip of 30 N per finger.
        lid_mass_kg: of the lid (PerAct2 code).
        friction: against its support, which is smoother. A push with rubber tips jams where the support's friction is
            near one.
    """

    name: str = "laptop"
    base_size_m: tuple[float, float, float] = (0.3474, 0.253, 0.0154)
    lid_size_m: tuple[float, float, float] = (0.34, 0.245, 0.0044)
    base_mass_kg: float = 0.7
    lid_mass_kg: float = 0.08
    friction: float = 0.35

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write base, hinge and lid."""
        base_half, lid_half = np.array(self.base_size_m) / 2, np.array(self.lid_size_m) / 2
        base = spec.worldbody.add_body(name=self.name)
        base.add_freejoint()
        self._add_solid(base, (0, 0, 0), base_half, self.base_mass_kg)
        add_slab(spec, self.name, base_half, CORNER_RADIUS_M)
        base.add_geom(type=MESH, meshname=self.name, rgba=ALUMINIUM, **VISUAL_ONLY)
        self._decorate_base(base, base_half)
        hinge = (0, base_half[1] - HINGE_INSET_M, base_half[2] + SEAM_M + lid_half[2])
        lid = base.add_body(name=f"{self.name}_lid", pos=hinge)
        lid.add_joint(
            name=f"{self.name}_hinge",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=(-1, 0, 0),
            range=(0, HINGE_RANGE_RAD),
            frictionloss=HINGE_FRICTION_NM,
            damping=0.01,
            solref_limit=(0.004, 1),
            solimp_limit=(0.98, 0.999, 0.001, 0.5, 2),
        )
        middle = (0, -lid_half[1], 0)
        self._add_solid(lid, middle, lid_half, self.lid_mass_kg)
        add_slab(spec, lid.name, lid_half, CORNER_RADIUS_M)
        lid.add_geom(type=MESH, meshname=lid.name, pos=middle, rgba=LID_ALUMINIUM, **VISUAL_ONLY)
        self._decorate_lid(lid, middle, lid_half)

    def _add_solid(self, body, position, half, mass: float) -> None:
        """What is felt: a plain box."""
        add_box(
            body,
            position,
            half,
            mass=mass,
            friction=(self.friction, 0.005, 0.0001),
            condim=4,
            solref=(0.005, 1),
            group=HIDDEN_GROUP,
        )

    def _decorate_base(self, body, half) -> None:
        """Keyboard and touch pad under the lid, the dark seam below it, sockets at the sides."""
        x, y, z = half
        sheet = SHEET_HALF_THICKNESS_M
        boxes = [
            ((0, 0.030, z), (0.80 * x, 0.42 * y, sheet)),
            ((0, -0.070, z), (0.30 * x, 0.26 * y, sheet)),
        ]
        for side in (-1, 1):
            for socket_y in (0.035, 0.060, 0.090):
                boxes.append(((side * x, socket_y, 0), (sheet, 0.007, 0.002)))
        for position, size in boxes:
            add_box(body, position, size, rgba=DARK, **VISUAL_ONLY)
        inset = 2 * CORNER_RADIUS_M
        add_box(body, (0, 0, z + SEAM_M / 2), (x - inset, y - 0.004, SEAM_M / 2), rgba=DARK, **VISUAL_ONLY)

    def _decorate_lid(self, body, middle, half) -> None:
        """A round badge outside, the screen inside."""
        x, y, z = half
        add_cylinder(body, (*middle[:2], z), 0.022, SHEET_HALF_THICKNESS_M, rgba=BADGE, **VISUAL_ONLY)
        add_box(
            body, (*middle[:2], -z), (0.94 * x, 0.90 * y, SHEET_HALF_THICKNESS_M), rgba=SCREEN, **VISUAL_ONLY
        )
