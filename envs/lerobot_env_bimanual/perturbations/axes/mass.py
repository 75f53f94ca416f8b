"""What the arms handle is heavier."""

import numpy as np

from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axes._free_bodies import free_bodies, has_free_bodies
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.task import TaskSpec


@register
class Mass(Axis):
    """Nothing of it is seen before something is lifted."""

    name = "mass"
    group = Group.BODIES
    levels = (1.2, 1.5, 2.0)
    unit = "times the mass"
    summary = "all things that move freely weigh more"
    source = "chosen here: from a fuller bottle to a full one"

    def applies_to(self, task: TaskSpec, model: mujoco.MjSpec) -> bool:
        """Whether anything moves freely."""
        return has_free_bodies(model)

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Scale masses and inertias."""
        model = start.scene.model
        factors = np.where(free_bodies(model), magnitude, 1.0)
        start.scene.alter(
            body_mass=model.body_mass * factors, body_inertia=model.body_inertia * factors[:, None]
        )
