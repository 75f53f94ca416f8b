"""A crumb of dirt to sweep up."""

from dataclasses import dataclass

import numpy as np

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.contact_layers import COMMON_LAYER, DIRT_ONLY
from lerobot_env_bimanual.props.prop import VISUAL_ONLY

EARTH = ((0.30, 0.18, 0.09, 1.0), (0.22, 0.13, 0.07, 1.0))

SLIDING_FRICTION = 0.5
ROLLING_FRICTION_M = 0.003
"""Large for a ball of this size: it only starts to roll on a slope of 12 degrees."""
LUMP_SHARE = 0.8

HIDDEN_GROUP = 3
BOX = mujoco.mjtGeom.mjGEOM_BOX
SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE


@dataclass(frozen=True)
class Crumb:
    """A free crumb, its frame in the middle.

    It is felt as a ball that hardly rolls, whose single point of contact is computed quickly, and seen as a lump.

    Attributes:
        name: body.
        radius_m: of the ball.
        mass_kg: that of dry earth; the original's half milligram is too light to simulate.
    """

    name: str
    radius_m: float = 0.0135
    mass_kg: float = 0.015

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the ball, and two cubes at an angle."""
        body = spec.worldbody.add_body(name=self.name)
        body.add_freejoint()
        body.add_geom(
            type=SPHERE,
            size=(self.radius_m, 0, 0),
            mass=self.mass_kg,
            friction=(SLIDING_FRICTION, 0.005, ROLLING_FRICTION_M),
            condim=6,
            solref=(0.004, 1),
            contype=COMMON_LAYER,
            conaffinity=COMMON_LAYER | DIRT_ONLY,
            group=HIDDEN_GROUP,
        )
        half = LUMP_SHARE * self.radius_m
        for angle, rgba in zip((0.0, np.pi / 4), EARTH, strict=True):
            quat = (np.cos(angle / 2), np.sin(angle / 2), 0, 0)
            body.add_geom(type=BOX, quat=quat, size=(half, half, half), rgba=rgba, **VISUAL_ONLY)
