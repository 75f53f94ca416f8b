"""Hand over the item, alone: the receiver picks it up itself, or rakes it nearer first."""

from collections.abc import Iterator
from functools import partial
from itertools import chain

import numpy as np

from adversaries._picking import PITCHES_RAD, Grip, base_of, grips
from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.handover_item import SIDE_M, TARGET
from lerobot_env_bimanual.world.scene_view import SceneView

HOVER_M = 0.10
BEHIND_M = 0.005
LIFT_M = 0.12
TIP_M = 0.01
"""From the tool centre point to the fingers' ends."""
PRESS_M = 0.005
RAKE_M = 0.20


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """From above if the arm reaches so far, otherwise with a tilted hand, otherwise after raking it nearer."""
    return pick_or_rake(scene, arm, TARGET, SIDE_M / 2, BEHIND_M)


def pick_or_rake(
    scene: SceneView, arm: Arm, item: str, half_height_m: float, behind_m: float
) -> Iterator[Strategy]:
    """The strategies for either item."""
    base_m = base_of(scene, arm)
    picking = (
        partial(pick_up, arm=arm, item=item, grip=grip, behind_m=behind_m)
        for grip in grips(scene.pose(item), base_m)
    )
    raking = (
        partial(rake, arm=arm, item=item, pitch_rad=pitch_rad, half_height_m=half_height_m, behind_m=behind_m)
        for pitch_rad in reversed(PITCHES_RAD)
    )
    return chain(picking, raking)


def pick_up(scene: SceneView, arm: Arm, item: str, grip: Grip, behind_m: float) -> Iterator[Stage]:
    """Before it, around it, up."""
    grasp = grip.at(scene.pose(item).position).advanced(-behind_m)
    yield alone(arm, "before", grasp.advanced(-HOVER_M), is_open=True, planned=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds=item)
    yield alone(arm, "lift", grasp.translated((0, 0, LIFT_M)))


def rake(
    scene: SceneView, arm: Arm, item: str, pitch_rad: float, half_height_m: float, behind_m: float
) -> Iterator[Stage]:
    """Press the fingertips on its upper side, draw it nearer, pick it up there."""
    item_m, base_m = scene.pose(item).position, base_of(scene, arm)
    away = (item_m - base_m) * (1, 1, 0) / np.linalg.norm((item_m - base_m)[:2])
    hand = Grip(np.cos(pitch_rad) * away - (0, 0, np.sin(pitch_rad)), np.cross((0, 0, 1), away))
    top = scene.pose(item).translated((0, 0, half_height_m - PRESS_M))
    press = hand.at(top.position).advanced(-TIP_M)
    yield alone(arm, "before", press.translated((0, 0, HOVER_M)), is_open=False)
    yield alone(arm, "press", press)
    yield alone(arm, "rake", press.translated(-RAKE_M * away))
    yield alone(arm, "leave", press.translated(-RAKE_M * away + (0, 0, HOVER_M)), is_open=True)
    yield from pick_up(scene, arm, item, next(grips(scene.pose(item), base_m)), behind_m)
