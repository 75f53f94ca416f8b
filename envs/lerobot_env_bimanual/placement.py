"""Where props are put: drawn on the table, and redrawn until the script can be rehearsed there."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lerobot_bimanual.errors import PlacementFailure
from lerobot_bimanual.geometry.pose import Pose

if TYPE_CHECKING:
    from lerobot_env_bimanual.episode.rehearsal import Rehearsal
    from lerobot_env_bimanual.task import Task, Variation
    from lerobot_env_bimanual.world.scene import Scene

MAX_DRAWS = 200


@dataclass(frozen=True)
class PlacementArea:
    """An upright rectangle on the table with a range of headings.

    Attributes:
        center_m: x and y of the middle, world frame.
        half_size_m: how far a prop's origin may lie from it along x and y.
        half_yaw_rad: how far a prop may be turned to either side about the vertical.
    """

    center_m: tuple[float, float]
    half_size_m: tuple[float, float]
    half_yaw_rad: float = 0.0

    def sample(self, rng: np.random.Generator, height_m: float) -> Pose:
        """A uniform upright pose with its origin at `height_m` above the floor."""
        xy = np.array(self.center_m) + rng.uniform(-1.0, 1.0, 2) * self.half_size_m
        return Pose.upright((*xy, height_m), rng.uniform(-1.0, 1.0) * self.half_yaw_rad)


def place_and_rehearse(task: Task, scene: Scene, variation: Variation, rng: np.random.Generator) -> int:
    """Draw placements until both arms can go through the whole script there.

    A placement counts only if the rehearsal succeeds with the exact keyposes and with those rounded to
    the voxels and bins of keypose policies, so that every episode is solvable by such a policy.

    Returns:
        Number of placements drawn.

    Raises:
        PlacementFailure: `MAX_DRAWS` draws in vain; the message counts the reasons.
    """
    rehearsal = task.rehearsal(scene)
    reasons: Counter[str] = Counter()
    for draw in range(1, MAX_DRAWS + 1):
        scene.reset()
        reason = _place_once(task, scene, variation, rng, rehearsal)
        if reason is None:
            scene.settle()
            return draw
        reasons[reason] += 1
    frequent = ", ".join(f"{count}x {reason}" for reason, count in reasons.most_common(3))
    raise PlacementFailure(
        f"{task.spec.name}: none of {MAX_DRAWS} drawn placements can be rehearsed by both arms ({frequent})"
    )


def _place_once(
    task: Task, scene: Scene, variation: Variation, rng: np.random.Generator, rehearsal: Rehearsal
) -> str | None:
    """Draw one placement; returns why it will not do, or None."""
    if not task.place(scene, variation, rng):
        return "illegal placement"
    return rehearsal.objection(lambda view: task.script(view, variation))
