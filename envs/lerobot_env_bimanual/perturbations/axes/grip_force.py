"""Hands that grip less firmly."""

import numpy as np

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register


@register
class GripForce(Axis):
    """What is held slips, or turns in the hand, when it is moved fast or gripped off its middle."""

    name = "grip_force"
    group = Group.ARMS
    levels = (0.8, 0.6, 0.4)
    unit = "times the force of the fingers"
    summary = "the motors of both hands close, and open, with less force"
    source = "chosen here: at level 0 a finger presses with 20 to 40 N, which is up to the real hand's continuous 70 N"

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Scale gain, bias and limit of the hands' motors; at rest they pull to the same width."""
        model = start.scene.model
        factors = np.ones((model.nu, 1))
        factors[[model.actuator(start.scene.arm_pair.actuator_names(arm)[-1]).id for arm in ARMS]] = magnitude
        start.scene.alter(
            actuator_gainprm=model.actuator_gainprm * factors,
            actuator_biasprm=model.actuator_biasprm * factors,
            actuator_forcerange=model.actuator_forcerange * factors,
        )
