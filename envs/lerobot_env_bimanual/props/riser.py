"""A low wooden block to put things on."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY, add_box

WALNUT = (0.36, 0.23, 0.16, 1.0)
OAK = (0.72, 0.56, 0.38, 1.0)
SHADOW = (0.16, 0.10, 0.08, 1.0)

TOP_BOARD_HALF_HEIGHT_M = 0.008
PLINTH_HALF_HEIGHT_M = 0.006
PROUD_M = 0.0006


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
        body = spec.worldbody.add_body(name=self.name)
        body.add_freejoint()
        add_box(
            body,
            (0, 0, 0),
            (x, y, z),
            name=self.name,
            mass=self.mass_kg,
            rgba=WALNUT,
            friction=(self.friction, 0.005, 0.0001),
            solref=(0.005, 1),
        )
        for middle_z, half_z, rgba in (
            (z - TOP_BOARD_HALF_HEIGHT_M + PROUD_M / 10, TOP_BOARD_HALF_HEIGHT_M, OAK),
            (-z + PLINTH_HALF_HEIGHT_M, PLINTH_HALF_HEIGHT_M, SHADOW),
        ):
            add_box(body, (0, 0, middle_z), (x + PROUD_M, y + PROUD_M, half_z), rgba=rgba, **VISUAL_ONLY)
