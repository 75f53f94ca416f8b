"""A light baking tray with a handle and a few biscuits."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props import prop

ALUMINIUM = (0.86, 0.87, 0.90, 1.0)
RIM = (0.74, 0.75, 0.79, 1.0)
PAPER = (0.95, 0.90, 0.78, 1.0)
BISCUIT = (0.76, 0.50, 0.24, 1.0)

RIM_HALF_M = (0.003, 0.009)
"""Half width and half height."""
RIM_MASS_SHARE = 0.16
PAPER_INSET_M = 0.012
PAPER_HALF_THICKNESS_M = 0.0004
BISCUIT_RADIUS_M = 0.021
BISCUIT_HALF_HEIGHT_M = 0.004


@dataclass(frozen=True)
class BakingTray:
    """A free board with a rim and a flat handle at its near end, -x. Its frame is in the middle of board and handle.

    Attributes:
        name: body and board geom.
        size_m: full sizes of board and handle together (PerAct2 code).
        handle_size_m: full depth along x and full width along y of the handle. It is short, so that a gripper has
            to aim.
        handle_height_m: full height of the handle; None for that of the board.
        mass_kg: everything (PerAct2 code); the biscuits are for the eye.
        friction: against everything but the grippers' rubber.
    """

    name: str = "tray"
    size_m: tuple[float, float, float] = (0.21, 0.30, 0.006)
    handle_size_m: tuple[float, float] = (0.043, 0.05)
    handle_height_m: float | None = None
    mass_kg: float = 0.315
    friction: float = 0.5

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write board, handle and rim, and paper and biscuits for the eye."""
        body = prop.add_free_body(spec, self.name)
        x, y, z = np.array(self.size_m) / 2
        handle_x, handle_y = np.array(self.handle_size_m) / 2
        board_x, board_half_x = handle_x, x - handle_x
        metal_kg = self.mass_kg * (1 - RIM_MASS_SHARE)
        handle_share = handle_x * handle_y / (handle_x * handle_y + board_half_x * y)
        board, metal = (board_half_x, y, z), {"rgba": ALUMINIUM, **prop.graspable(self.friction)}
        prop.add_box(
            body, (board_x, 0, 0), board, name=self.name, mass=metal_kg * (1 - handle_share), **metal
        )
        handle = (handle_x, handle_y, z if self.handle_height_m is None else self.handle_height_m / 2)
        prop.add_box(body, (handle_x - x, 0, 0), handle, mass=metal_kg * handle_share, **metal)
        self._add_rim(body, board_x, board)
        self._add_biscuits(body, board_x, board)

    def _add_rim(self, body, board_x: float, board) -> None:
        x, y, z = board
        width, height = RIM_HALF_M
        rim = {"rgba": RIM, "mass": self.mass_kg * RIM_MASS_SHARE / 4, **prop.graspable(self.friction)}
        for side in (-1, 1):
            for position, size in (
                ((board_x + side * (x - width), 0, z + height), (width, y, height)),
                ((board_x, side * (y - width), z + height), (x, width, height)),
            ):
                prop.add_box(body, position, size, **rim)

    def _add_biscuits(self, body, board_x: float, board) -> None:
        x, y, z = board
        paper = (x - PAPER_INSET_M, y - PAPER_INSET_M, PAPER_HALF_THICKNESS_M)
        prop.add_visual_box(body, (board_x, 0, z), paper, rgba=PAPER)
        for column in np.linspace(-1, 1, 2) * 0.45 * x:
            for row in np.linspace(-1, 1, 4) * 0.66 * y:
                place = (board_x + column, row, z + BISCUIT_HALF_HEIGHT_M)
                prop.add_cylinder(
                    body, place, BISCUIT_RADIUS_M, BISCUIT_HALF_HEIGHT_M, rgba=BISCUIT, **prop.VISUAL_ONLY
                )
