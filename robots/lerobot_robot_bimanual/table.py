"""The task's world as a robot has it: it has no time limit, and nothing is seen before somebody looks."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.conditions import check
from lerobot_env_bimanual.env import BimanualEnv

logger = logging.getLogger(__name__)


class Table(BimanualEnv):
    """One episode after another, without a time limit, as people need longer than experts.

    An episode that is solved, or whose simulation became unstable, stands still until the next one.
    """

    @property
    def _truncated(self) -> bool:
        return False

    def tick(self, joint_action: NDArray[np.float32]) -> None:
        """Go on for 50 ms towards a joint action (16,) within the limits, unless the episode is over."""
        if self.progress.terminated:
            return
        self._tick(joint_action)
        if self.progress.terminated:
            self._finish_video()
            self.tell()

    def tell(self) -> None:
        """Log how the episode stands."""
        progress = self.progress
        if progress.succeeded:
            verdict = "solved"
        else:
            conditions = check(self._conditions, self.scene, known=progress.conditions)
            unmet = [name for name, met in conditions.items() if not met]
            verdict = progress.failure or f"not solved, unmet: {', '.join(unmet)}"
        logger.info(
            "%s: %s after %d ticks, state %s",
            self.name_of_episode,
            verdict,
            progress.ticks,
            self.state_hash(),
        )

    @property
    def name_of_episode(self) -> str:
        """What determines the episode: task, perturbation, variation, split and seed."""
        world = f"{self.task} with {self.options.perturb}" if self.options.perturb else self.task
        return f"{world}, variation {self.variation}, {self.options.split} seed {self.progress.seed}"
