"""Doors, drawers, buttons and hinges move less easily."""

import numpy as np

from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.perturbations.axes._joints import has_joints, joints_of_things
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register
from lerobot_env_bimanual.task import TaskSpec


@register
class Stiffness(Axis):
    """Hands that hold a handle have to pull harder, and are pulled aside."""

    name = "stiffness"
    group = Group.BODIES
    levels = (1.5, 2.0, 3.0)
    unit = "times the spring, the damping and the friction"
    summary = "all joints of things resist more: doors, drawers, buttons, lids, what bends"
    source = "chosen here: from another maker's drawer to one that nobody has oiled"

    def applies_to(self, task: TaskSpec, model: mujoco.MjSpec) -> bool:
        """Whether anything has joints."""
        return has_joints(model)

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Scale what resists."""
        model = start.scene.model
        factors = np.where(joints_of_things(start.scene), magnitude, 1.0)
        of_dofs = factors[model.dof_jntid]
        start.scene.alter(
            jnt_stiffness=model.jnt_stiffness * factors,
            dof_damping=model.dof_damping * of_dofs,
            dof_frictionloss=model.dof_frictionloss * of_dofs,
        )
