"""Push the two buttons, alone: lay hand and wrist along the line between them, or push one after the other."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.dual_push_buttons import HOVER_Z_M, LEFT, PRESS_Z_M, RIGHT
from lerobot_env_bimanual.world.scene_view import SceneView

LYING_Z_M = 0.806
"""Of the tool centre point of a hand that lies on pressed caps."""
RAISED_M = 0.10
AHEAD_M = (0.14, 0.18)
"""From the middle between the buttons to the tool centre point: the rest of the hand and its wrist lie behind."""
NOSE_DOWN_RAD = np.deg2rad(7.0)
"""So that fingertips and wrist touch at the same height."""


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """Fingertips on one and wrist on the other, along the line between them; or in turn."""
    a, b = (scene.pose(button).position for button in (LEFT, RIGHT))
    middle, between = (a + b) / 2, (b - a) / np.linalg.norm(b - a)
    for ahead_m, side in product(AHEAD_M, (1, -1)):
        yield partial(_lay, arm=arm, at=middle + ahead_m * side * between, heading=side * between)
    yield partial(_in_turn, arm=arm)


def _lay(scene: SceneView, arm: Arm, at: np.ndarray, heading: np.ndarray) -> Iterator[Stage]:
    """Above, down with the flat side."""
    approach = np.cos(NOSE_DOWN_RAD) * heading - (0, 0, np.sin(NOSE_DOWN_RAD))
    lying = Pose.looking((*at[:2], LYING_Z_M), approach, np.cross((0, 0, 1), heading))
    yield alone(arm, "above", lying.translated((0, 0, RAISED_M)), is_open=False, planned=True)
    for lower_m in (0.0, 0.01, 0.02):
        yield alone(arm, "lie down", lying.translated((0, 0, -lower_m)))


def _in_turn(scene: SceneView, arm: Arm) -> Iterator[Stage]:
    """Press one, then the other."""
    for button in (LEFT, RIGHT):
        x, y, _ = scene.pose(button).position
        hand = partial(Pose.looking, approach=(0, 0, -1), opening=(1, 0, 0))
        yield alone(arm, "above", hand((x, y, HOVER_Z_M)), is_open=False, planned=True)
        yield alone(arm, "press", hand((x, y, PRESS_Z_M)))
        yield alone(arm, "up", hand((x, y, HOVER_Z_M)))
