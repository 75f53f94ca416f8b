"""Starts episodes: placements are drawn until both arms can do the task."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import PlacementFailure
from lerobot_env_bimanual.episode.progress import EpisodeProgress
from lerobot_env_bimanual.episode.rehearsal import Rehearsal
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Task
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

MAX_DRAWS = 200
CODECS = (None, KeyposeCodec())

type Perturb = Callable[[Task, Scene, EpisodeProgress, Callable[[], bool]], None]
"""Changes an episode that can be done as it is, after its props were placed and before they come to rest.

It may ask whether both arms can do the task in the present scene, by a rehearsal of the script.
"""


class EpisodeReset:
    """Starts episodes of one task in one scene.

    Args:
        task: whose props are placed, and whose script is rehearsed.
        scene: its world.
        perturb: changes every episode.
        is_patched: whether the model of `scene` differs from the task's; placements are then drawn in one that does not.
    """

    def __init__(self, task: Task, scene: Scene, perturb: Perturb, is_patched: bool = False):
        self._task = task
        self._scene = scene
        self._perturb = perturb
        self._rehearsal = Rehearsal(scene, CODECS)
        self._drawn_in = Scene(scene.props, setting=scene.setting) if is_patched else scene
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

        def script(view: SceneView) -> Iterator[Stage]:
            return self._task.script(view, progress.variation)

        reasons: Counter[str] = Counter()
        for draw in range(1, MAX_DRAWS + 1):
            self._drawn_in.reset()
            reason = "illegal placement"
            if self._task.place(self._drawn_in, progress.variation, progress.rng):
                reason = self._first_rehearsal.infeasibility(script)
            if reason is None:
                if self._drawn_in is not self._scene:
                    self._scene.reset()
                    self._scene.place_like(self._drawn_in)
                self._perturb(
                    self._task, self._scene, progress, lambda: self._rehearsal.infeasibility(script) is None
                )
                self._scene.settle()
                return draw
            reasons[reason] += 1
        frequent = ", ".join(f"{count}x {reason}" for reason, count in reasons.most_common(3))
        raise PlacementFailure(
            f"{self._task.spec.name}: none of {MAX_DRAWS} drawn placements can be rehearsed by both arms "
            f"({frequent})"
        )
