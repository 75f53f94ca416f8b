"""Everything is more slippery."""

import numpy as np

from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register


@register
class Friction(Axis):
    """The friction at work in every contact is scaled, between hands and things as between things and table.

    Of two surfaces that touch MuJoCo takes the friction of the one with priority (the grippers' rubber, wet glaze, the
    ball), else the larger one; pairs of their own overrule both. So a thing's own value alone would change few contacts
    or none. All values times one factor change each contact by that factor, whichever rule it falls under.
    """

    name = "friction"
    group = Group.BODIES
    levels = (0.85, 0.7, 0.5)
    unit = "times the friction"
    summary = "all contacts slide, twist and roll more easily, those of the fingers included"
    source = "chosen here: rubber from clean to dusty, a table from dry to polished"

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Scale the friction of all surfaces and pairs."""
        model = start.scene.model
        start.scene.alter(
            geom_friction=model.geom_friction * magnitude, pair_friction=model.pair_friction * magnitude
        )
