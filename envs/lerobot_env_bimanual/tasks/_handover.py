"""How one hand picks an item up, presents it in the air, and the other hand takes it.

Both hands approach along y, since the bases stand too close together to exchange anything along the line between
them. Both are rolled by 45 degrees, so that their fingers cross at a right angle and never meet, and no hand is at a
singularity of the Euler angles.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.world.scene_view import SceneView

HOVER_M = 0.10
LIFT_TO_M = 1.12
EXCHANGE = np.array([0.25, -0.10, 1.105])
"""Where the item's centre is presented; within easy reach of both arms."""
CLEARANCE_M = 0.12
"""How far the right hand waits before the item and the left one withdraws."""
LEFT_PRESENTS = Pose.looking((0, 0, 0), approach=(0, -1, 0), opening=(1, 0, 1))
RIGHT_RECEIVES = Pose.looking((0, 0, 0), approach=(0, 1, 0), opening=(-1, 0, 1))


def hand_over(scene: SceneView, item: str, left_behind_m: float, right_behind_m: float) -> Iterator[Stage]:
    """Pick up, present, receive where the item really is, release, withdraw.

    Args:
        scene: the item stands upright within the left arm's reach.
        item: a prop with vertical, square sides.
        left_behind_m: how far the left tool centre point stops short of the item's centre.
        right_behind_m: the same of the right one; the sum keeps the fingertips apart.
    """
    pose = scene.pose(item)
    down = Pose.looking(pose.position, approach=(0, 0, -1), opening=grasp_axis(pose))
    grasp = down.advanced(-left_behind_m)
    present = LEFT_PRESENTS.translated(EXCHANGE).advanced(-left_behind_m)
    wait = RIGHT_RECEIVES.translated(EXCHANGE).advanced(-right_behind_m - CLEARANCE_M)
    yield Stage("hover", grasp.advanced(-HOVER_M), wait, planned=True)
    yield Stage("grasp", left=grasp, left_open=False, left_holds=item)
    yield Stage("lift", left=grasp.translated((0, 0, LIFT_TO_M - grasp.position[2])))
    yield Stage("present", left=present)
    receive = RIGHT_RECEIVES.translated(scene.pose(item).position).advanced(-right_behind_m)
    yield Stage("receive", right=receive, right_open=False, right_holds=item)
    yield Stage("release", left_open=True)
    yield Stage("withdraw", left=present.advanced(-CLEARANCE_M))


def grasp_axis(item: Pose) -> np.ndarray:
    """The horizontal axis (3,) of an item along which the left fingers open.

    Of four equivalent ones always that within 45 degrees of +x, so that neighbouring placements have the same
    keyposes.
    """
    sides = item.rotation[:, :2].T
    both_ways = np.concatenate([sides, -sides])
    return both_ways[both_ways[:, 0].argmax()]
