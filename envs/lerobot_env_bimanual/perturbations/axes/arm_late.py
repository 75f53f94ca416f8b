"""One arm is told everything later than the other."""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.perturbations.axis import Axis, Group
from lerobot_env_bimanual.perturbations.registry import register


@register
class ArmLate(Axis):
    """What both arms hold together is torn or squeezed while one of them lags."""

    name = "arm_late"
    group = Group.ARMS
    levels = (1, 2, 4)
    unit = "control ticks of 50 ms"
    summary = "one arm, drawn for the episode, follows its commands later; the end of a keypose's motion is waited for"
    source = "chosen here: two controllers on one network, from a dropped cycle to a busy computer"

    def late_ticks(self, magnitude: float) -> int:
        """The lag."""
        return int(magnitude)

    def command(
        self,
        action: NDArray[np.float32],
        progress: EpisodeProgress,
        magnitude: float,
        rng: np.random.Generator,
    ) -> NDArray[np.float32]:
        """Give one arm what was meant for it some ticks ago; before there was any, what comes first."""
        late = progress.memory.setdefault(self.name, {"arm": int(rng.integers(len(ARMS))), "meant": [action]})
        late["meant"] = [*late["meant"][-int(magnitude) :], action]
        told = action.copy()
        by_arm(told)[late["arm"]] = by_arm(late["meant"][0])[late["arm"]]
        return told
