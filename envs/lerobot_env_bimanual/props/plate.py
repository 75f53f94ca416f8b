"""A small dinner plate with a flared rim."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from lerobot_bimanual.geometry.rotations import euler_xyz_to_quat_wxyz
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.meshes import add_mesh, add_visual_mesh, lathe
from lerobot_env_bimanual.props.prop import COLLISION_ONLY, add_box, add_cylinder, add_free_body, graspable

PORCELAIN = (0.97, 0.97, 0.95, 1.0)
GLAZE = (0.17, 0.38, 0.63, 1.0)

THICKNESS_M = 0.0025
WELL_Z_M = 0.00475
"""Middle of the thickness."""
FOOT_INSIDE_WELL_M = 0.004
FOOT_HEIGHT_M = 0.004
FOOT_RING_WIDTH_M = 0.005
FOOT_MASS_SHARE, WELL_MASS_SHARE, RIM_MASS_SHARE = 0.30, 0.25, 0.45
RIM_PARTS = 16

GLAZE_BANDS = ((0.06, 0.14), (0.78, 1.0))
"""Painted rings, as shares of the way up the rim."""
GLAZE_PROUD_M = 0.0005


@dataclass(frozen=True)
class Plate:
    """A free plate, its frame in the middle of the foot's underside.

    It is drawn as a turned mesh; it collides as two discs and a rim of boxes, because collision shapes are convex.

    Attributes:
        name: body.
        radius_m: of the rim's upper edge (PerAct2 code).
        height_m: of the rim's upper edge; the original's is 1.8 cm.
        rim_m: its width, seen from above; narrow, so that only a press near its edge tips the plate.
        mass_kg: that of real porcelain; the original's half gram is too light to simulate.
        friction: against everything, the grippers' rubber included: wet glaze. At the rubber's own friction, or at 0.5,
            a steep hand pinches the sloping rim where it lies.
    """

    name: str = "plate"
    radius_m: float = 0.075
    height_m: float = 0.012
    rim_m: float = 0.015
    mass_kg: float = 0.12
    friction: float = 0.35

    @property
    def well_radius_m(self) -> float:
        """Where the rim begins."""
        return self.radius_m - self.rim_m

    @property
    def foot_radius_m(self) -> float:
        """Of the foot's outer edge."""
        return self.well_radius_m - FOOT_INSIDE_WELL_M

    @property
    def rim_slope_rad(self) -> float:
        """Angle of the rim above the horizontal."""
        return math.atan2(self.height_m - WELL_Z_M, self.rim_m)

    @property
    def tip_rad(self) -> float:
        """Angle at which the plate, tipped over its foot, stands on the edge of its rim."""
        return math.atan2(self.height_m - THICKNESS_M / 2, self.radius_m - self.foot_radius_m)

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the collision shapes and the visible meshes."""
        body = add_free_body(spec, self.name)
        # Its friction wins over the fingertips'.
        contact = {"priority": 2, **graspable(self.friction), **COLLISION_ONLY}
        for radius, middle, height, share in (
            (self.foot_radius_m, FOOT_HEIGHT_M / 2, FOOT_HEIGHT_M, FOOT_MASS_SHARE),
            (self.well_radius_m, WELL_Z_M, THICKNESS_M, WELL_MASS_SHARE),
        ):
            add_cylinder(body, (0, 0, middle), radius, height / 2, mass=share * self.mass_kg, **contact)
        self._add_rim(body, contact)
        add_mesh(spec, self.name, lathe(self._profile()))
        add_visual_mesh(body, self.name, rgba=PORCELAIN)
        for number, band in enumerate(GLAZE_BANDS):
            mesh = f"{self.name}_band{number}"
            add_mesh(spec, mesh, lathe(self._band_profile(*band)))
            add_visual_mesh(body, mesh, rgba=GLAZE)

    def _add_rim(self, body, contact: dict[str, Any]) -> None:
        """Boxes side by side around the well, sloping up to the edge."""
        run, rise = self.rim_m, self.height_m - WELL_Z_M
        half = (np.hypot(run, rise) / 2, self.radius_m * math.tan(np.pi / RIM_PARTS), THICKNESS_M / 2)
        middle_radius, middle_z = self.well_radius_m + run / 2, WELL_Z_M + rise / 2
        for angle in np.arange(RIM_PARTS) * 2 * np.pi / RIM_PARTS:
            place = (middle_radius * np.cos(angle), middle_radius * np.sin(angle), middle_z)
            turned = euler_xyz_to_quat_wxyz((0, -self.rim_slope_rad, angle))
            mass = RIM_MASS_SHARE / RIM_PARTS * self.mass_kg
            add_box(body, place, half, quat=turned, mass=mass, **contact)

    def _on_rim(self, share: float, height_m: float) -> tuple[float, float]:
        """Radius and z at a share of the way up the rim, `height_m` from the middle of its thickness."""
        slope = self.rim_slope_rad
        radius = self.well_radius_m + share * self.rim_m
        z = WELL_Z_M + share * (self.height_m - WELL_Z_M)
        return radius - height_m * np.sin(slope), z + height_m * np.cos(slope)

    def _profile(self) -> list[tuple[float, float]]:
        """Outline for the lathe: foot ring, underside, edge, upper side."""
        half = THICKNESS_M / 2
        corner = half * math.tan(self.rim_slope_rad / 2)
        below, above = WELL_Z_M - half, WELL_Z_M + half
        inner_foot = self.foot_radius_m - FOOT_RING_WIDTH_M
        return [
            (0, below / 2),
            (inner_foot, below / 2),
            (inner_foot, 0),
            (self.foot_radius_m, 0),
            (self.foot_radius_m, below),
            (self.well_radius_m + corner, below),
            self._on_rim(1, -half),
            self._on_rim(1, half),
            (self.well_radius_m - corner, above),
            (0, above),
        ]

    def _band_profile(self, start: float, end: float) -> list[tuple[float, float]]:
        """A sheet inside the porcelain that comes out a little between two shares of the rim."""
        proud = THICKNESS_M / 2 + GLAZE_PROUD_M
        hidden = THICKNESS_M / 8
        return [
            (0, WELL_Z_M - hidden),
            (self.well_radius_m, WELL_Z_M - hidden),
            self._on_rim(end, -hidden),
            self._on_rim(end, proud),
            self._on_rim(start, proud),
            self._on_rim(start, hidden),
            (self.well_radius_m, WELL_Z_M + hidden),
            (0, WELL_Z_M + hidden),
        ]
