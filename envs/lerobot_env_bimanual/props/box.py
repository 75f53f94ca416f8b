"""A parcel too heavy for one arm to push."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import add_box, add_free_body, add_visual_box

CARDBOARD = (0.76, 0.58, 0.38, 1.0)
TAPE = (0.66, 0.62, 0.86, 1.0)
LABEL = (0.97, 0.96, 0.93, 1.0)
PRINT = (0.25, 0.22, 0.20, 1.0)
PAPER_THICKNESS_M = 0.0004


@dataclass(frozen=True)
class Box:
    """A free, heavy parcel, its frame in the middle.

    Attributes:
        name: body and geom.
        size_m: full sizes (PerAct2 code).
        mass_kg: the paper's 50 kg.
        table_friction: of the table contact alone. At 0.38 (186 N) two arms always move the box and one arm gets it
            some of the way, or all of it if it also lifts (docs/environment.md); at 0.37 the left one alone gets it all
            the way, though seldom onto the target.
    """

    name: str = "box"
    size_m: tuple[float, float, float] = (0.384, 0.192, 0.128)
    mass_kg: float = 50.0
    table_friction: float = 0.38

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the parcel, its tape and label, and its contact with the table."""
        half = np.array(self.size_m) / 2
        body = add_free_body(spec, self.name)
        contact = {"mass": self.mass_kg, "friction": (0.5, 0.005, 0.0001), "solref": (0.01, 1)}
        add_box(body, (0, 0, 0), half, name=self.name, rgba=CARDBOARD, **contact)
        # Of two geoms the larger friction counts, and the table's is 0.5: only an explicit pair can be lower.
        spec.add_pair(
            geomname1="table",
            geomname2=self.name,
            condim=4,
            friction=(self.table_friction, self.table_friction, 0.005, 0.0001, 0.0001),
            solref=(0.03, 1),  # a stiffer one makes the box hop and strike the hands
        )
        self._decorate(body, half)

    def _decorate(self, body, half) -> None:
        """Tape along the top seam and down both ends, and an address label."""
        x, y, z = half
        tape_half_width, tape_end = 0.022, 0.045
        paper = PAPER_THICKNESS_M
        sheets = [
            ((0, 0, z), (x, tape_half_width, paper), TAPE),
            ((0.55 * x, -0.55 * y, z), (0.045, 0.028, paper), LABEL),
            ((0.50 * x, -0.48 * y, z + paper), (0.028, 0.0025, paper), PRINT),
            ((0.53 * x, -0.58 * y, z + paper), (0.034, 0.0025, paper), PRINT),
            ((0.50 * x, -0.68 * y, z + paper), (0.028, 0.0025, paper), PRINT),
        ]
        for side in (-1, 1):
            sheets.append(((side * x, 0, z - tape_end), (paper, tape_half_width, tape_end), TAPE))
        for position, size, rgba in sheets:
            add_visual_box(body, position, size, rgba=rgba)
