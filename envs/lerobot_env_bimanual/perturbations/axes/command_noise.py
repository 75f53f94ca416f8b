"""Arms that go a little beside where they are sent."""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, JOINTS_PER_ARM
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.reset import EpisodeStart
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register

PERIOD_S = (4.0, 12.0)
"""Of each joint's drift, drawn once per episode; about as long as a task takes."""


@register
class CommandNoise(Axis):
    """Every joint drifts to and fro about its commands, slowly and on its own.

    Servos of a real arm hear no noise from tick to tick: encoders resolve 0.001 degrees, and a filter would take it
    away. What they have are offsets that stay or wander: zeros that are off, gears that wind up, links that warm up.
    """

    name = "command_noise"
    group = Group.ARMS
    levels = (0.2, 0.4, 0.6)
    unit = "degrees in each joint, at most"
    summary = "joint targets drift on a sine of 4 to 12 s with an amplitude of its own for each joint; grippers do not"
    source = "chosen here: joint zeros of arms that were calibrated well, in a hurry, and never"

    def begin(self, start: EpisodeStart, magnitude: float, rng: np.random.Generator) -> None:
        """Draw amplitudes (a share of the magnitude, with sign) and frequencies; a drift begins at zero."""
        shape = (len(ARMS), JOINTS_PER_ARM)
        start.progress.memory[self.name] = {
            "share": rng.uniform(-1.0, 1.0, shape),
            "rad_per_tick": 2 * np.pi / (rng.uniform(*PERIOD_S, shape) * CONTROL_HZ),
        }

    def command(
        self,
        action: NDArray[np.float32],
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> NDArray[np.float32]:
        """Add the drift of the tick."""
        drift = progress.memory[self.name]
        told = action.copy()
        offsets = drift["share"] * np.sin(drift["rad_per_tick"] * progress.ticks)
        by_arm(told)[:, :-1] += np.deg2rad(magnitude) * offsets
        return told
