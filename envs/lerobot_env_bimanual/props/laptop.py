"""A closed laptop computer, and the low wooden block that it lies on."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop
from lerobot_env_bimanual.props.meshes import add_mesh, add_visual_mesh, slab

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

WALNUT = (0.36, 0.23, 0.16, 1.0)
OAK = (0.72, 0.56, 0.38, 1.0)
SHADOW = (0.16, 0.10, 0.08, 1.0)
TOP_BOARD_HALF_HEIGHT_M = 0.008
PLINTH_HALF_HEIGHT_M = 0.006
PROUD_M = 0.0006
"""How far the block's top board and plinth stand out of it."""


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
        base = prop.add_free_body(spec, self.name)
        self._add_solid(base, (0, 0, 0), base_half, self.base_mass_kg)
        add_mesh(spec, self.name, slab(base_half, CORNER_RADIUS_M))
        add_visual_mesh(base, self.name, rgba=ALUMINIUM)
        self._decorate_base(base, base_half)
        hinge = (0, base_half[1] - HINGE_INSET_M, base_half[2] + SEAM_M + lid_half[2])
        lid = base.add_body(name=f"{self.name}_lid", pos=hinge)
        limits, brake = (0, HINGE_RANGE_RAD), (HINGE_FRICTION_NM, 0.01)
        stiff = {"solref_limit": (0.004, 1), "solimp_limit": (0.98, 0.999, 0.001, 0.5, 2)}
        prop.add_joint(lid, prop.HINGE, f"{self.name}_hinge", (-1, 0, 0), limits, *brake, **stiff)
        middle = (0, -lid_half[1], 0)
        self._add_solid(lid, middle, lid_half, self.lid_mass_kg)
        add_mesh(spec, lid.name, slab(lid_half, CORNER_RADIUS_M))
        add_visual_mesh(lid, lid.name, pos=middle, rgba=LID_ALUMINIUM)
        self._decorate_lid(lid, middle, lid_half)

    def _add_solid(self, body, position, half, mass: float) -> None:
        """The collision shape: a plain box."""
        contact = {"friction": (self.friction, 0.005, 0.0001), "condim": 4, "solref": (0.005, 1)}
        prop.add_box(body, position, half, mass=mass, priority=1, **contact, **prop.COLLISION_ONLY)

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
            prop.add_visual_box(body, position, size, rgba=DARK)
        inset = 2 * CORNER_RADIUS_M
        prop.add_visual_box(body, (0, 0, z + SEAM_M / 2), (x - inset, y - 0.004, SEAM_M / 2), rgba=DARK)

    def _decorate_lid(self, body, middle, half) -> None:
        """A round badge outside, the screen inside."""
        x, y, z = half
        prop.add_cylinder(
            body, (*middle[:2], z), 0.022, SHEET_HALF_THICKNESS_M, rgba=BADGE, **prop.VISUAL_ONLY
        )
        prop.add_visual_box(
            body, (*middle[:2], -z), (0.94 * x, 0.90 * y, SHEET_HALF_THICKNESS_M), rgba=SCREEN
        )


@dataclass(frozen=True)
class Riser:
    """A free, heavy block, its frame in the middle.

    Attributes:
        name: body and geom.
        size_m: full sizes (PerAct2 code).
        mass_kg: enough to stay where it is while something is pushed over it (PerAct2 code).
        friction: low, so that what is pushed over it slides by its own; against the table, the table's counts.
    """

    name: str = "holder"
    size_m: tuple[float, float, float] = (0.40, 0.30, 0.10)
    mass_kg: float = 12.0
    friction: float = 0.3

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the block, and a light board around its top and a dark joint above its foot for the eye."""
        x, y, z = np.array(self.size_m) / 2
        body = prop.add_free_body(spec, self.name)
        contact = {"mass": self.mass_kg, "friction": (self.friction, 0.005, 0.0001), "solref": (0.005, 1)}
        prop.add_box(body, (0, 0, 0), (x, y, z), name=self.name, rgba=WALNUT, **contact)
        for middle_z, half_z, rgba in (
            (z - TOP_BOARD_HALF_HEIGHT_M + PROUD_M / 10, TOP_BOARD_HALF_HEIGHT_M, OAK),
            (-z + PLINTH_HALF_HEIGHT_M, PLINTH_HALF_HEIGHT_M, SHADOW),
        ):
            prop.add_visual_box(body, (0, 0, middle_z), (x + PROUD_M, y + PROUD_M, half_z), rgba=rgba)
