"""A cabinet with three drawers, one above the other."""

from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop
from lerobot_env_bimanual.props.meshes import add_mesh, add_visual_mesh, lathe

CASE = (0.72, 0.624, 0.48, 1.0)
FRONT = (0.80, 0.71, 0.57, 1.0)
PANEL = (0.86, 0.78, 0.65, 1.0)
TRAY = (0.66, 0.57, 0.43, 1.0)
LEG = (0.42, 0.33, 0.24, 1.0)
GAP = (0.17, 0.13, 0.10, 1.0)
METAL = (0.28, 0.28, 0.31, 1.0)

LEVELS = ("bottom", "middle", "top")
HANDLE_HEIGHTS_M = {"bottom": 0.165, "middle": 0.285, "top": 0.405}
"""Above the table (PerAct2 code); the heights of the drawers' frames, too."""
TRAVEL_M = 0.30
"""How far a drawer comes out (PerAct2 code)."""
SLIDE_FRICTION_N = 0.6
"""Brake that keeps a drawer where it was left, when the hand lets go of its handle."""
SLIDE_DAMPING_N_S_M = 2.0

SIDE_M = 0.375
LEG_HEIGHT_M = 0.092
WALL_HALF_M = 0.00375
LEG_RADIUS_M = (0.019, 0.011)
"""At the top of a leg and at its foot."""
LEG_INSET_M = 0.024

# Half sizes of a drawer's parts; x is its width, +y its way out.
FRONT_HALF_M = (0.180, 0.006, 0.056)
TRAY_HALF_M = (0.168, 0.170, 0.035)
"""Outside, without the floor's thickness."""
BOARD_HALF_M = 0.004
FLOOR_HALF_M = 0.003
FLOOR_Z_M = -0.045
TRAY_WALL_Z_M = -0.012
FRONT_GAP_M = 0.001
HANDLE_STAND_OFF_M = 0.040
"""Between bar and front: room for two fingers."""
HANDLE_Y_M = SIDE_M / 2 + FRONT_GAP_M + 2 * FRONT_HALF_M[1] + HANDLE_STAND_OFF_M
POST_RADIUS_M = 0.005
FIRM = (0.004, 1.0)
"""Contact of the boards: as hard as the step of physics allows, or a dropped block would sink through the floor."""
PART_MASSES_KG = {"front": 0.12, "floor": 0.08, "wall": 0.04, "bar": 0.03, "post": 0.01}


@dataclass(frozen=True)
class DrawerCabinet:
    """A cabinet that stands still, with drawers that slide out along +y. Its frame lies on the table, under its middle.

    Attributes:
        name: body; also the prefix of the drawers' bodies (`..._top`) and slides (`..._top_slide`).
        handle_half_length_m: of the straight part of a drawer's bar.
        handle_radius_m: of that bar.
        handle_gives_m: how far it gives to both sides, on rubber.
        longer_legs_m: by how much the legs go on below the frame, so that the cabinet can be placed higher.
    """

    top_m: ClassVar[float] = LEG_HEIGHT_M + SIDE_M
    """Height of the top above the table."""

    name: str = "cabinet"
    handle_half_length_m: float = 0.0375
    handle_radius_m: float = 0.0075
    handle_gives_m: float = 0.0
    longer_legs_m: float = 0.0

    def drawer(self, level: str) -> str:
        """Name of a drawer's body."""
        return f"{self.name}_{level}"

    def handle(self, level: str) -> NDArray[np.float64]:
        """(3,) middle of a closed drawer's handle in the cabinet's frame, m."""
        return np.array([0.0, HANDLE_Y_M, HANDLE_HEIGHTS_M[level]])

    @property
    def drawer_inside(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Lower and upper corner of the room in a drawer, in the drawer's frame, m."""
        x = TRAY_HALF_M[0] - 2 * BOARD_HALF_M
        near = SIDE_M / 2 - 2 * TRAY_HALF_M[1] + 2 * BOARD_HALF_M
        rim = TRAY_WALL_Z_M + TRAY_HALF_M[2]
        return (-x, near, FLOOR_Z_M + FLOOR_HALF_M), (x, SIDE_M / 2, rim)

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write case, legs and drawers."""
        body = spec.worldbody.add_body(name=self.name)
        self._add_case(body)
        self._add_legs(spec, body)
        for level in LEVELS:
            self._add_drawer(body, level)
            # With a play of a few millimetres, they never meet: their collisions need not be checked.
            spec.add_exclude(bodyname1=self.name, bodyname2=self.drawer(level))

    def _add_case(self, body) -> None:
        half, wall, middle = SIDE_M / 2, WALL_HALF_M, LEG_HEIGHT_M + SIDE_M / 2
        for side in (-1, 1):
            inset = side * (half - wall)
            prop.add_box(body, (inset, 0, middle), (wall, half, half), rgba=CASE)
            prop.add_box(body, (0, 0, middle + inset), (half - 2 * wall, half, wall), rgba=CASE)
        inner = half - 2 * wall
        prop.add_box(body, (0, wall - half, middle), (inner, wall, inner), rgba=CASE)
        # What is seen through the gaps between the fronts.
        for height in (0.225, 0.345):
            prop.add_visual_box(body, (0, half - 0.004, height), (inner, 0.003, 0.006), rgba=GAP)

    def _add_legs(self, spec, body) -> None:
        top, foot = LEG_RADIUS_M
        mesh = f"{self.name}_leg"
        low, half = -self.longer_legs_m, (LEG_HEIGHT_M + self.longer_legs_m) / 2
        add_mesh(spec, mesh, lathe([(0, low), (foot, low), (top, LEG_HEIGHT_M), (0, LEG_HEIGHT_M)]))
        for x, y in product((-(SIDE_M / 2 - LEG_INSET_M), SIDE_M / 2 - LEG_INSET_M), repeat=2):
            add_visual_mesh(body, mesh, pos=(x, y, 0), rgba=LEG)
            prop.add_cylinder(body, (x, y, low + half), top, half, **prop.COLLISION_ONLY)

    def _add_drawer(self, cabinet, level: str) -> None:
        drawer = cabinet.add_body(name=self.drawer(level), pos=(0, 0, HANDLE_HEIGHTS_M[level]))
        brake = (SLIDE_FRICTION_N, SLIDE_DAMPING_N_S_M)
        prop.add_joint(drawer, prop.SLIDE, f"{self.drawer(level)}_slide", (0, 1, 0), (0, TRAVEL_M), *brake)
        front_y = SIDE_M / 2 + FRONT_GAP_M + FRONT_HALF_M[1]
        self._add_board(drawer, "front", (0, front_y, 0), FRONT_HALF_M, FRONT)
        x, y, z = TRAY_HALF_M
        middle = SIDE_M / 2 - y
        self._add_board(drawer, "floor", (0, middle, FLOOR_Z_M), (x, y, FLOOR_HALF_M), TRAY)
        back = (0, middle - y + BOARD_HALF_M, TRAY_WALL_Z_M)
        self._add_board(drawer, "wall", back, (x, BOARD_HALF_M, z), TRAY)
        for side in (-1, 1):
            place = (side * (x - BOARD_HALF_M), middle, TRAY_WALL_Z_M)
            self._add_board(drawer, "wall", place, (BOARD_HALF_M, y, z), TRAY)
        self._add_handle(drawer)
        panel = (FRONT_HALF_M[0] - 0.022, 0.0008, FRONT_HALF_M[2] - 0.018)
        prop.add_visual_box(drawer, (0, front_y + FRONT_HALF_M[1], 0), panel, rgba=PANEL)

    def _add_board(self, body, part: str, position, half, rgba) -> None:
        prop.add_box(body, position, half, mass=PART_MASSES_KG[part], rgba=rgba, solref=FIRM)

    def _add_handle(self, drawer) -> None:
        y, x, gives_m = HANDLE_Y_M, self.handle_half_length_m, self.handle_gives_m
        if gives_m:
            rubber = f"{drawer.name}_rubber"
            drawer = drawer.add_body(name=f"{drawer.name}_handle")
            prop.add_joint(drawer, prop.SLIDE, rubber, (1, 0, 0), (-gives_m, gives_m), **prop.ON_RUBBER)
        bar = (-x, y, 0, x, y, 0)
        prop.add_capsule(drawer, bar, self.handle_radius_m, mass=PART_MASSES_KG["bar"], rgba=METAL)
        for side in (-x, x):
            post = (side, y, 0, side, y - HANDLE_STAND_OFF_M, 0)
            prop.add_capsule(drawer, post, POST_RADIUS_M, mass=PART_MASSES_KG["post"], rgba=METAL)
