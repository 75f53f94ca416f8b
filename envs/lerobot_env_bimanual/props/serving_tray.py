"""A wooden serving tray with a handle at each end."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY, add_box
from lerobot_env_bimanual.props.slab import add_slab
from lerobot_env_bimanual.props.tray_board import add_board

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

HIDDEN_GROUP = 3
MESH = mujoco.mjtGeom.mjGEOM_MESH


@dataclass(frozen=True)
class ServingTray:
    """A free board with a raised rim and two flat handles, its frame in the middle of the board.

    The handles lie flat beyond the short ends, so that a gripper with upright fingers can pinch them, and are
    short, so that it has to aim: a lip along the whole end was gripped by chance in a third of all placements.

    Attributes:
        name: body and board geom.
        size_m: full sizes of the board without handles; its long side lies along y.
        handle_size_m: full width along x and full depth along y of a handle.
        rim_height_m: of the rim above the board.
        mass_kg: everything (PerAct2 code).
        friction: against everything but the grippers' rubber.
    """

    name: str = "tray"
    size_m: tuple[float, float, float] = (0.24, 0.324, 0.006)
    handle_size_m: tuple[float, float] = (0.085, 0.043)
    rim_height_m: float = 0.015
    mass_kg: float = 0.45
    friction: float = 0.6

    @property
    def _handle_mesh(self) -> str:
        return f"{self.name}_handle"

    @property
    def _inlay_mesh(self) -> str:
        return f"{self.name}_inlay"

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write board, handles and rim, and a mat and inlays for the eye."""
        body = spec.worldbody.add_body(name=self.name)
        body.add_freejoint()
        x, y, z = np.array(self.size_m) / 2
        handle_area = 2 * self.handle_size_m[0] * self.handle_size_m[1]
        wood_density = self.mass_kg * (1 - RIM_MASS_SHARE) / (4 * x * y + handle_area)
        add_board(body, (0, 0, 0), (x, y, z), WOOD, 4 * x * y * wood_density, self.friction, name=self.name)
        handle_half = (self.handle_size_m[0] / 2, self.handle_size_m[1] / 2, z)
        add_slab(spec, self._handle_mesh, handle_half, radius_m=CORNER_RADIUS_M)
        inlay_half = np.subtract(handle_half, (INLAY_INSET_M, INLAY_INSET_M, -SHEET_HALF_THICKNESS_M))
        add_slab(spec, self._inlay_mesh, inlay_half, radius_m=inlay_half[1])
        for side in (-1, 1):
            self._add_handle(body, side * (y + self.handle_size_m[1] / 2), wood_density * handle_area / 2)
        self._add_rim(body, x, y, z)
        self._add_mat(body, x, y, z)

    def _add_handle(self, body, y: float, mass: float) -> None:
        """Felt as a box, seen as a slab with rounded corners and an inlay."""
        half = (*np.array(self.handle_size_m) / 2, self.size_m[2] / 2)
        add_board(body, (0, y, 0), half, WOOD, mass, self.friction, group=HIDDEN_GROUP)
        for mesh, rgba in ((self._handle_mesh, WOOD), (self._inlay_mesh, INLAY)):
            body.add_geom(type=MESH, meshname=mesh, pos=(0, y, 0), rgba=rgba, **VISUAL_ONLY)

    def _add_rim(self, body, x: float, y: float, z: float) -> None:
        bar, height = RIM_WIDTH_M / 2, self.rim_height_m / 2
        mass = self.mass_kg * RIM_MASS_SHARE / 4
        for side in (-1, 1):
            along, across = (side * (x - bar), 0, z + height), (0, side * (y - bar), z + height)
            add_board(body, along, (bar, y, height), RIM_WOOD, mass, self.friction)
            add_board(body, across, (x - 2 * bar, bar, height), RIM_WOOD, mass, self.friction)

    def _add_mat(self, body, x: float, y: float, z: float) -> None:
        """A linen mat with a stripe along either long side."""
        half_x, half_y = x - RIM_WIDTH_M - MAT_INSET_M, y - RIM_WIDTH_M - MAT_INSET_M
        sheet = SHEET_HALF_THICKNESS_M
        add_box(body, (0, 0, z), (half_x, half_y, sheet), rgba=LINEN, **VISUAL_ONLY)
        for side in (-1, 1):
            add_box(
                body,
                (side * (half_x - 4 * STRIPE_HALF_WIDTH_M), 0, z + sheet),
                (STRIPE_HALF_WIDTH_M, half_y, sheet),
                rgba=STRIPE,
                **VISUAL_ONLY,
            )
