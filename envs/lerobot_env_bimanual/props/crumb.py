"""A crumb of dirt to sweep up."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.arena import BRISTLES, COMMON_LAYER
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import VISUAL_ONLY

EARTH = (0.30, 0.18, 0.09, 1.0)
DARK_EARTH = (0.22, 0.13, 0.07, 1.0)

BOX = mujoco.mjtGeom.mjGEOM_BOX


@dataclass(frozen=True)
class Crumb:
    """A free, small cube with a knobbly look, its frame in the middle.

    Attributes:
        name: body.
        side_m: of the cube.
        mass_kg: the original's half milligram is too light to simulate.
    """

    name: str
    side_m: float = 0.015
    mass_kg: float = 0.002

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the cube, and a smaller, turned one that breaks its outline."""
        half = self.side_m / 2
        body = spec.worldbody.add_body(name=self.name)
        body.add_freejoint()
        body.add_geom(
            type=BOX,
            size=(half, half, half),
            mass=self.mass_kg,
            rgba=EARTH,
            friction=(0.5, 0.005, 0.0001),
            contype=COMMON_LAYER,
            conaffinity=COMMON_LAYER | BRISTLES,
        )
        knob = 0.72 * half
        quat = (np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8))
        body.add_geom(
            type=BOX,
            pos=(0, 0, 0.45 * half),
            quat=quat,
            size=(knob, knob, knob),
            rgba=DARK_EARTH,
            **VISUAL_ONLY,
        )
