"""Starts episodes: placements are drawn until both arms can do the task."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.task import Task, Variation
from lerobot_env_bimanual.world.scene import Scene

MAX_DRAWS = 200
CODECS = (None, KeyposeCodec())


@dataclass(frozen=True)
class EpisodeStart:
    """An episode whose props have been placed and have not yet come to rest.

    Attributes:
        task: its task.
        scene: its world.
        progress: the episode itself.
        is_feasible: rehearses the task's script in the present scene, and says whether both arms can do it.
    """

    task: Task
    scene: Scene
    progress: EpisodeProgress
    is_feasible: Callable[[], bool]


class EpisodeReset:
    """Starts episodes of one task in one scene.

    Args:
        task: whose props are placed, and whose script is rehearsed.
        scene: its world.
        perturb: changes an episode that can be done as it is, before things come to rest.
        is_patched: whether the model of `scene` differs from the task's; placements are then drawn in one that does not.
    """

    def __init__(
        self,
        task: Task,
        scene: Scene,
        perturb: Callable[[EpisodeStart], None],
        is_patched: bool = False,
    ):
        self._task = task
        self._scene = scene
        self._perturb = perturb
        self._rehearsal = Rehearsal(scene, CODECS)
        self._drawn_in = Scene(task.spec.props) if is_patched else scene
        self._first_rehearsal = Rehearsal(self._drawn_in, CODECS) if is_patched else self._rehearsal

    def start(self, progress: EpisodeProgress) -> int:
        """Reset the scene, place the props where the script can be rehearsed, and let them settle.

        A placement counts only if the rehearsal succeeds with the exact keyposes and with those rounded to
        the voxels and bins of keypose policies, so that every episode is solvable by such a policy.

        Args:
            progress: the episode: its variation says what to colour or to choose, its generator is drawn from.

        Returns:
            Number of placements drawn.

        Raises:
            PlacementFailure: `MAX_DRAWS` draws in vain; the message counts the reasons.
        """
        reasons: Counter[str] = Counter()
        for draw in range(1, MAX_DRAWS + 1):
            self._drawn_in.reset()
            reason = self._place(progress.variation, progress.rng)
            if reason is None:
                if self._drawn_in is not self._scene:
                    self._scene.reset()
                    self._scene.place_like(self._drawn_in)
                is_feasible = partial(self._is_feasible, progress.variation)
                self._perturb(EpisodeStart(self._task, self._scene, progress, is_feasible))
                self._scene.settle()
                return draw
            reasons[reason] += 1
        frequent = ", ".join(f"{count}x {reason}" for reason, count in reasons.most_common(3))
        raise PlacementFailure(
            f"{self._task.spec.name}: none of {MAX_DRAWS} drawn placements can be rehearsed by both arms "
            f"({frequent})"
        )

    def _place(self, variation: Variation, rng: np.random.Generator) -> str | None:
        """Draw one placement; returns why it cannot be used, or None."""
        if not self._task.place(self._drawn_in, variation, rng):
            return "illegal placement"
        return self._first_rehearsal.infeasibility(lambda view: self._task.script(view, variation))

    def _is_feasible(self, variation: Variation) -> bool:
        return self._rehearsal.infeasibility(lambda view: self._task.script(view, variation)) is None
