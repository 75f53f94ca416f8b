"""How an episode starts: props are drawn, and redrawn until both arms can do the task there."""

from __future__ import annotations

from collections import Counter

import numpy as np

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.task import Task, Variation
from lerobot_env_bimanual.world.scene import Scene

MAX_DRAWS = 200


class EpisodeReset:
    """Starts episodes of one task in one scene.

    Args:
        task: whose props are placed, and whose script is rehearsed.
        scene: its world.
    """

    def __init__(self, task: Task, scene: Scene):
        self._task = task
        self._scene = scene
        self._rehearsal = Rehearsal(scene, codecs=(None, KeyposeCodec()))

    def start(self, variation: Variation, rng: np.random.Generator) -> int:
        """Reset the scene, place the props where the script can be rehearsed, and let them settle.

        A placement counts only if the rehearsal succeeds with the exact keyposes and with those rounded to
        the voxels and bins of keypose policies, so that every episode is solvable by such a policy.

        Args:
            variation: what to colour or to choose.
            rng: the episode's generator.

        Returns:
            Number of placements drawn.

        Raises:
            PlacementFailure: `MAX_DRAWS` draws in vain; the message counts the reasons.
        """
        reasons: Counter[str] = Counter()
        for draw in range(1, MAX_DRAWS + 1):
            self._scene.reset()
            reason = self._place(variation, rng)
            if reason is None:
                self._scene.settle()
                return draw
            reasons[reason] += 1
        frequent = ", ".join(f"{count}x {reason}" for reason, count in reasons.most_common(3))
        raise PlacementFailure(
            f"{self._task.spec.name}: none of {MAX_DRAWS} drawn placements can be rehearsed by both arms "
            f"({frequent})"
        )

    def _place(self, variation: Variation, rng: np.random.Generator) -> str | None:
        """Draw one placement; returns why it will not do, or None."""
        if not self._task.place(self._scene, variation, rng):
            return "illegal placement"
        return self._rehearsal.infeasibility(lambda view: self._task.script(view, variation))
