"""The room is lit otherwise."""

import numpy as np

from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle, quat_wxyz_to_matrix
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.world.appearance import Appearance

TURN_RAD = np.deg2rad(150)
STOPS = 0.6
WARMTH = 0.3
"""What is done at magnitude 1; half of it at half."""


@register
class Light(Axis):
    """Lamps are carried around the table, dimmed or turned up, made warmer or colder; at last they cast shadows."""

    name = "light"
    group = Group.SEEN
    levels = (0.25, 0.5, 1.0)
    unit = "share of a turn by 150 degrees, of 0.6 stops of strength, and of 30 % more or less red and blue"
    summary = (
        "lamps stand elsewhere, are weaker or stronger, warmer or colder; at level 3 they also cast shadows"
    )
    source = "chosen here: from another hour of the day to another room"

    def build(self, model: mujoco.MjSpec, magnitude: float) -> None:
        """Have the even light, which is no lamp, come from the last lamp."""
        even = model.visual.headlight
        model.lights[-1].ambient = even.ambient
        even.ambient = (0, 0, 0)

    def look(
        self, start: EpisodeStart, appearance: Appearance, magnitude: float, rng: np.random.Generator
    ) -> Appearance:
        """Draw to which side each of them is changed."""
        model = start.scene.model
        way, strength, warmth = magnitude * rng.choice((-1, 1), size=3)
        turn = quat_wxyz_to_matrix(quat_wxyz_from_axis_angle((0, 0, 1), way * TURN_RAD))
        colour = 2 ** (strength * STOPS) * (1 + warmth * np.array([WARMTH, 0, -WARMTH]))
        centre = model.stat.center * (1, 1, 0)
        lit = appearance.wearing(
            light_pos=centre + (model.light_pos - centre) @ turn.T,
            light_dir=model.light_dir @ turn.T,
            light_ambient=model.light_ambient * colour,
            light_diffuse=model.light_diffuse * colour,
        )
        return lit.shadowed() if magnitude == self.levels[-1] else lit
