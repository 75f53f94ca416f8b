"""Table, floor and walls look otherwise."""

import numpy as np

from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axes._patterns import PATTERNS, paint
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.world.appearance import Appearance
from lerobot_env_bimanual.world.arena import MAPLE, OAK_GREY, PAINT
from lerobot_env_bimanual.world.textures import add_material

SIDE_PIXELS = 128
SURFACES = {"table": (MAPLE, (2.0, 2.0)), "floor": (OAK_GREY, (6.0, 6.0)), "wall": (PAINT, (4.0, 2.5))}
"""Material of each, with its colour and how often a pattern is repeated along its sides."""
DARKEST = 0.25
"""No drawn colour has less of a channel, so that none is as strong as those of the things that language names."""
TINT = 0.9
"""Share of the way from a surface's own colour to a drawn one, at magnitude 1."""


@register
class Surfaces(Axis):
    """What a policy has seen behind every object of its training is gone."""

    name = "surfaces"
    group = Group.SEEN
    levels = (0.1, 0.25, 0.5)
    unit = "contrast of the pattern; the colour goes 0.9 of it towards a drawn one"
    summary = "table, floor and walls each get one of four patterns (checks, stripes, dots, clouds) and another colour"
    source = "chosen here: from another cloth to one of strong checks"

    def build(self, model: mujoco.MjSpec, magnitude: float) -> None:
        """Add every pattern for every surface; what is worn is drawn by the episode."""
        for surface, (_, repeat) in SURFACES.items():
            for pattern in PATTERNS:
                image = paint(pattern, SIDE_PIXELS, magnitude)
                add_material(model, _material(surface, pattern), image, repeat)

    def look(
        self, start: EpisodeStart, appearance: Appearance, magnitude: float, rng: np.random.Generator
    ) -> Appearance:
        """Draw a pattern and a colour for each surface."""
        model = start.scene.model
        materials = appearance.fields.get("geom_matid", model.geom_matid).copy()
        colours = appearance.fields.get("geom_rgba", model.geom_rgba).copy()
        for surface, (own, _) in SURFACES.items():
            pattern, drawn = rng.choice(list(PATTERNS)), rng.uniform(DARKEST, 1, size=3)
            geoms = model.geom_matid == model.material(surface).id
            materials[geoms] = model.material(_material(surface, pattern)).id
            colours[geoms, :3] = own + TINT * magnitude * (drawn - own)
        return appearance.wearing(geom_matid=materials, geom_rgba=colours)


def _material(surface: str, pattern: str) -> str:
    return f"{surface}_{pattern}"
