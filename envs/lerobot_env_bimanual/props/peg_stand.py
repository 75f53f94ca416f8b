"""A stand of four pegs that holds something flat off the table."""

from dataclasses import dataclass

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY, add_box, add_capsule, add_cylinder

PLATE = (0.30, 0.31, 0.34, 1.0)
STEEL = (0.62, 0.64, 0.68, 1.0)
RUBBER = (0.16, 0.16, 0.17, 1.0)

PLATE_HALF_THICKNESS_M = 0.004
PLATE_MARGIN_M = 0.015
PEG_RADIUS_M = 0.007
FOOT = (0.013, 0.008, 0.007)
COLLAR = (0.009, 0.095, 0.010)
"""Rubber rings for the eye: radius, height of the underside and height, in metres."""


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
        thickness = PLATE_HALF_THICKNESS_M
        add_box(
            body, (0, 0, thickness), (peg_x + PLATE_MARGIN_M, peg_y + PLATE_MARGIN_M, thickness), rgba=PLATE
        )
        for side_x in (-1, 1):
            for side_y in (-1, 1):
                self._add_peg(body, side_x * peg_x, side_y * peg_y)

    def _add_peg(self, body, x: float, y: float) -> None:
        # Round tops touch what they carry in one point each, which is stable and cheap.
        top = self.height_m - PEG_RADIUS_M
        add_capsule(body, (x, y, 0.01, x, y, top), PEG_RADIUS_M, rgba=STEEL)
        for radius, bottom, height in (FOOT, COLLAR):
            add_cylinder(body, (x, y, bottom + height / 2), radius, height / 2, rgba=RUBBER, **VISUAL_ONLY)
