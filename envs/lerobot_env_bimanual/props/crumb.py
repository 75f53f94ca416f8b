"""A crumb of dirt to sweep up."""

from dataclasses import dataclass

from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.props.prop import COMMON_LAYER, DIRT_ONLY, add_free_body, add_sphere

EARTH = (0.26, 0.16, 0.08, 1.0)

SLIDING_FRICTION = 0.5
ROLLING_FRICTION_M = 0.003
"""Large for a ball of this size: it only starts to roll on a slope of 11 degrees."""


@dataclass(frozen=True)
class Crumb:
    """A free lump of earth, its frame in the middle: a ball that hardly rolls, whose contacts are computed quickly.

    Attributes:
        name: body.
        radius_m: of the ball.
        mass_kg: about that of water; the original's half milligram is too light to simulate.
    """

    name: str
    radius_m: float = 0.015
    mass_kg: float = 0.015

    def add_to(self, spec: mujoco.MjSpec) -> None:
        """Write the ball."""
        add_sphere(
            add_free_body(spec, self.name),
            (0, 0, 0),
            self.radius_m,
            mass=self.mass_kg,
            rgba=EARTH,
            friction=(SLIDING_FRICTION, 0.005, ROLLING_FRICTION_M),
            condim=6,
            solref=(0.004, 1),
            contype=COMMON_LAYER,
            conaffinity=COMMON_LAYER | DIRT_ONLY,
        )
