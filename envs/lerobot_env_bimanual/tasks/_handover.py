"""Handover script: one hand picks up an item beyond the other's reach and presents it in the air; the other takes it.

Both hands approach along y, since the bases stand too close together to exchange anything along the line between
them. Both are rolled by 45 degrees, so that their fingers cross at a right angle and never meet, and no hand is at a
singularity of the Euler angles.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea
from lerobot_env_bimanual.world.scene_view import SceneView

AREA_CENTER_M, AREA_HALF_SIZE_M = (0.0, 0.36), (0.15, 0.11)
"""Area of the table where items lie. Further left the left arm's base hides them from all cameras but one."""
MIN_REACH_M = np.array([0.34, 0.98])
"""Distance from the left and the right base to an item's middle, along the table. Nearer to its base the left arm comes close to
its joint limits. The right arm's fingers get no further than 0.94 m at the height of a cube's top and 0.95 m at that of
the tall block's, whatever its posture; the items' nearest corners may be 2.8 cm nearer than their middles."""
MAX_DRAWS = 500
"""Places that are drawn for an item before the placement is given up."""

HOVER_M = 0.10
LIFT_M = 0.18
EXCHANGE_M, EXCHANGE_SHARE = np.array([0.25, -0.10, 1.075]), np.array([0.9, 0.7, 1.0])
"""Where the centre of an item from the middle of the area is presented, and the factors by which an item's offset from that
middle along x, y and z shifts it; within easy reach of both arms."""
YAW_LIFTS_M_RAD = 0.08
"""Change of the presented height per rad of an item's yaw."""
CLEARANCE_M = 0.12
"""Distance at which the right hand waits before the item, and by which the left hand withdraws."""
LEFT_PRESENTS = Pose.looking((0, 0, 0), approach=(0, -1, 0), opening=(1, 0, 1))
RIGHT_RECEIVES = Pose.looking((0, 0, 0), approach=(0, 1, 0), opening=(-1, 0, 1))


def draw_place(
    scene: SceneView,
    rng: np.random.Generator,
    height_m: float,
    half_yaw_rad: float,
    is_free: Callable[[Pose], bool] = lambda pose: True,
) -> Pose | None:
    """Draw an upright pose, uniformly, where the left arm reaches an item and the right arm does not touch it.

    Args:
        scene: where the arms stand.
        rng: the episode's generator.
        height_m: of the item's origin above the floor.
        half_yaw_rad: how far the item may be turned to either side.
        is_free: whether the place is not taken by another item.

    Returns:
        The first of `MAX_DRAWS` poses that fulfils this and is free; None if none does.
    """
    area = PlacementArea(AREA_CENTER_M, AREA_HALF_SIZE_M, half_yaw_rad)
    bases_m = np.array([scene.arm_pair.base_pose(arm).position[:2] for arm in ARMS])

    def is_valid_pose(pose: Pose) -> bool:
        reach_m = np.linalg.norm(pose.position[:2] - bases_m, axis=1)
        return bool((reach_m >= MIN_REACH_M).all()) and is_free(pose)

    drawn = (area.sample(rng, height_m) for _ in range(MAX_DRAWS))
    return next(filter(is_valid_pose, drawn), None)


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
    exchange = exchange_m(pose)
    present = LEFT_PRESENTS.translated(exchange).advanced(-left_behind_m)
    wait = RIGHT_RECEIVES.translated(exchange).advanced(-right_behind_m - CLEARANCE_M)
    yield Stage("hover", grasp.advanced(-HOVER_M), wait, planned=True)
    yield Stage("grasp", left=grasp, left_open=False, left_holds=item)
    yield Stage("lift", left=grasp.translated((0, 0, LIFT_M)))
    yield Stage("present", left=present, planned=True)
    receive = RIGHT_RECEIVES.translated(scene.pose(item).position).advanced(-right_behind_m)
    yield Stage("receive", right=receive, right_open=False, right_holds=item)
    yield Stage("release", left_open=True)
    yield Stage("withdraw", left=present.advanced(-CLEARANCE_M))


def exchange_m(item: Pose) -> np.ndarray:
    """(3,) where an item's centre is presented: over its side of the table, at a height that follows from its own and its yaw."""
    along = grasp_axis(item)
    offset_m = item.position - (*AREA_CENTER_M, TABLE_HEIGHT_M)
    lifted_m = YAW_LIFTS_M_RAD * math.atan2(along[1], along[0])
    return EXCHANGE_M + EXCHANGE_SHARE * offset_m + (0, 0, lifted_m)


def grasp_axis(item: Pose) -> np.ndarray:
    """The horizontal axis (3,) of an item along which the left fingers open.

    Of four equivalent ones always that within 45 degrees of +x, so that neighbouring placements have the same
    keyposes.
    """
    sides = item.rotation[:, :2].T
    both_ways = np.concatenate([sides, -sides])
    return both_ways[both_ways[:, 0].argmax()]
