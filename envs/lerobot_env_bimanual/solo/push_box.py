"""Push the box to the red area, alone: strike it again and again, steering by where it is struck."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.solo.ways import Way, alone
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.world.scene_view import SceneView

START_Y_M = -0.165
PUSH_Z_M = 0.785
ABOVE_Z_M = 0.985
END_M = 0.13
TURN_M_PER_RAD = 0.6
FIRST_M = {Arm.LEFT: -0.05, Arm.RIGHT: 0.05}
"""From the box's middle towards either end."""
STRIKE_M = 0.12
"""How far beyond the box's place each push is commanded."""
ROUNDS = 11
NEAR_M = 0.03
REACH_M = 0.128
"""From the box's middle to the middle of a hand that touches its long side."""


def ways(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Way]:
    """Nearer to the arm at first, where it is stronger."""
    yield partial(_strike, arm=arm, first_m=FIRST_M[arm])


def _strike(scene: SceneView, arm: Arm, first_m: float) -> Iterator[Stage]:
    """Behind it, push; back, push again where it looks past the target, until it is there."""
    for number in range(ROUNDS):
        box, target = scene.pose("box"), scene.pose("target")
        goal = box.inverse().apply((*target.position[:2], box.position[2]))
        if np.linalg.norm(goal[:2]) < NEAR_M:
            return
        # It turns away from the end that is pushed.
        off_rad = np.arctan2(goal[0], goal[1])
        x_m = first_m if number == 0 else float(np.clip(-TURN_M_PER_RAD * off_rad, -END_M, END_M))
        if number == 0:
            yield alone(arm, "above", _hand(box, x_m, START_Y_M, ABOVE_Z_M), is_open=False, planned=True)
        yield alone(arm, "behind", _hand(box, x_m, START_Y_M, PUSH_Z_M))
        beyond_m = min(STRIKE_M, goal[1]) + (STRIKE_M if number else 0.0)
        yield alone(arm, "push", _hand(box, x_m, beyond_m - REACH_M, PUSH_Z_M))


def _hand(box: Pose, x_m: float, y_m: float, height_m: float) -> Pose:
    """Straight down at a point of the box's axes, its broad side to the box."""
    x, y, _ = box.apply((x_m, y_m, 0))
    return Pose.looking((x, y, height_m), approach=(0, 0, -1), opening=box.rotation[:, 0])
