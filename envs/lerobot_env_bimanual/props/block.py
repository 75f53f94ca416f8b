"""A wooden block that one hand can pinch and hand over."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import add_box, add_free_body, add_visual_box, graspable

RED = (1.0, 0.0, 0.0, 1.0)
PAPER = (0.97, 0.96, 0.92, 1)
LABEL_THICKNESS_M = 0.0003


@dataclass(frozen=True)
class Block:
    """A free block standing on its square end, its frame in the middle.

    Attributes:
        name: body and geom.
        size_m: full sizes; PerAct2's easy handover item is twice the cube of the hard one.
        mass_kg: that of light wood.
        rgba: colour.
    """

    name: str = "item"
    size_m: tuple[float, float, float] = (0.04, 0.04, 0.08)
    mass_kg: float = 0.128
    rgba: tuple[float, float, float, float] = RED

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the block and a paper label around its waist."""
        half = np.array(self.size_m) / 2
        body = add_free_body(spec, self.name)
        add_box(body, (0, 0, 0), half, name=self.name, mass=self.mass_kg, rgba=self.rgba, **graspable(0.8))
        label = (half[0] + LABEL_THICKNESS_M, half[1] + LABEL_THICKNESS_M, 0.12 * half[2])
        add_visual_box(body, (0, 0, 0), label, rgba=PAPER)
