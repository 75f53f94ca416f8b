"""A wooden serving tray with a handle at each end, and a stand of four pegs that holds it off the table."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop
from lerobot_env_bimanual.props.meshes import add_mesh, add_visual_mesh, slab

WOOD = (0.70, 0.50, 0.30, 1.0)
RIM_WOOD = (0.52, 0.34, 0.19, 1.0)
LINEN = (0.91, 0.89, 0.82, 1.0)
STRIPE = (0.36, 0.50, 0.62, 1.0)
INLAY = (0.33, 0.21, 0.12, 1.0)

RIM_MASS_SHARE = 0.2
RIM_WIDTH_M = 0.008
MAT_INSET_M = 0.006
STRIPE_HALF_WIDTH_M = 0.004
SHEET_HALF_THICKNESS_M = 0.0004
INLAY_INSET_M = 0.015
CORNER_RADIUS_M = 0.012

PLATE = (0.30, 0.31, 0.34, 1.0)
STEEL = (0.62, 0.64, 0.68, 1.0)
RUBBER = (0.16, 0.16, 0.17, 1.0)
PLATE_HALF_THICKNESS_M = 0.004
PLATE_MARGIN_M = 0.015
PEG_RADIUS_M = 0.007
FOOT = (0.013, 0.008, 0.007)
COLLAR = (0.009, 0.095, 0.010)
"""Rubber rings of the pegs, for the eye: radius, height of the underside and height, in metres."""


@dataclass(frozen=True)
class ServingTray:
    """A free board with a raised rim and two flat handles, its frame in the middle of the board.

    The handles lie flat beyond the short ends, so that a gripper with upright fingers can pinch them, and are
    short, so that it has to aim: a lip along the whole end was gripped by chance in a third of all placements.

    Attributes:
        name: body and board geom.
        size_m: full sizes of the board without handles; its long side lies along y.
        handle_size_m: full width along x and full depth along y of a handle.
        handle_height_m: full height of a handle; None for that of the board.
        rim_height_m: of the rim above the board.
        mass_kg: everything (PerAct2 code).
        friction: against everything but the grippers' rubber.
    """

    name: str = "tray"
    size_m: tuple[float, float, float] = (0.24, 0.324, 0.006)
    handle_size_m: tuple[float, float] = (0.045, 0.043)
    handle_height_m: float | None = None
    rim_height_m: float = 0.015
    mass_kg: float = 0.45
    friction: float = 0.6

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write board, handles and rim, and a mat and inlays for the eye."""
        body = prop.add_free_body(spec, self.name)
        contact = prop.graspable(self.friction)
        x, y, z = np.array(self.size_m) / 2
        handle_area = 2 * self.handle_size_m[0] * self.handle_size_m[1]
        wood_density = self.mass_kg * (1 - RIM_MASS_SHARE) / (4 * x * y + handle_area)
        board_kg = 4 * x * y * wood_density
        prop.add_box(body, (0, 0, 0), (x, y, z), name=self.name, mass=board_kg, rgba=WOOD, **contact)
        # The handles collide as boxes, and are drawn as slabs with rounded corners and an inlay.
        handle_z = z if self.handle_height_m is None else self.handle_height_m / 2
        handle_half = (self.handle_size_m[0] / 2, self.handle_size_m[1] / 2, handle_z)
        inlay_half = np.subtract(handle_half, (INLAY_INSET_M, INLAY_INSET_M, -SHEET_HALF_THICKNESS_M))
        handle_mesh, inlay_mesh = f"{self.name}_handle", f"{self.name}_inlay"
        add_mesh(spec, handle_mesh, slab(handle_half, CORNER_RADIUS_M))
        add_mesh(spec, inlay_mesh, slab(inlay_half, inlay_half[1]))
        handle_kg = wood_density * handle_area / 2
        for side in (-1, 1):
            middle = (0, side * (y + self.handle_size_m[1] / 2), 0)
            prop.add_box(
                body, middle, handle_half, mass=handle_kg, rgba=WOOD, **contact, **prop.COLLISION_ONLY
            )
            add_visual_mesh(body, handle_mesh, pos=middle, rgba=WOOD)
            add_visual_mesh(body, inlay_mesh, pos=middle, rgba=INLAY)
        self._add_rim(body, x, y, z)
        self._add_mat(body, x, y, z)

    def _add_rim(self, body, x: float, y: float, z: float) -> None:
        bar, height = RIM_WIDTH_M / 2, self.rim_height_m / 2
        rim = {"mass": self.mass_kg * RIM_MASS_SHARE / 4, "rgba": RIM_WOOD, **prop.graspable(self.friction)}
        for side in (-1, 1):
            prop.add_box(body, (side * (x - bar), 0, z + height), (bar, y, height), **rim)
            prop.add_box(body, (0, side * (y - bar), z + height), (x - 2 * bar, bar, height), **rim)

    def _add_mat(self, body, x: float, y: float, z: float) -> None:
        """A linen mat with a stripe along either long side."""
        half_x, half_y = x - RIM_WIDTH_M - MAT_INSET_M, y - RIM_WIDTH_M - MAT_INSET_M
        sheet = SHEET_HALF_THICKNESS_M
        prop.add_visual_box(body, (0, 0, z), (half_x, half_y, sheet), rgba=LINEN)
        for side in (-1, 1):
            place = (side * (half_x - 4 * STRIPE_HALF_WIDTH_M), 0, z + sheet)
            prop.add_visual_box(body, place, (STRIPE_HALF_WIDTH_M, half_y, sheet), rgba=STRIPE)


@dataclass(frozen=True)
class PegStand:
    """A static base plate with four pegs. Its frame lies in the middle of the underside.

    Attributes:
        name: body.
        height_m: from the table to the pegs' tops.
        peg_offset_m: x and y of a peg from the middle.
    """

    name: str = "stand"
    height_m: float = 0.122
    peg_offset_m: tuple[float, float] = (0.07, 0.10)

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the plate, the pegs, and their rubber rings."""
        body = spec.worldbody.add_body(name=self.name)
        peg_x, peg_y = self.peg_offset_m
        half_z = PLATE_HALF_THICKNESS_M
        plate = (peg_x + PLATE_MARGIN_M, peg_y + PLATE_MARGIN_M, half_z)
        prop.add_box(body, (0, 0, half_z), plate, rgba=PLATE)
        # Round tops touch what they carry in one point each, which is stable and cheap.
        top = self.height_m - PEG_RADIUS_M
        for x, y in product((-peg_x, peg_x), (-peg_y, peg_y)):
            prop.add_capsule(body, (x, y, 0.01, x, y, top), PEG_RADIUS_M, rgba=STEEL)
            for radius, bottom, height in (FOOT, COLLAR):
                middle = (x, y, bottom + height / 2)
                prop.add_cylinder(body, middle, radius, height / 2, rgba=RUBBER, **prop.VISUAL_ONLY)
