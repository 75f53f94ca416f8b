"""Push the box to the red area, alone: strike it again and again, steering by where it is struck."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.push_box import ABOVE_Z_M, PUSH_Z_M, pushing_hand
from lerobot_env_bimanual.world.scene_view import SceneView

BEHIND_M = 0.025
"""Behind the box, from where it is struck."""
END_M = 0.13
TURN_M_PER_RAD = 0.6
STRIKES_M = ((0.3, 0.0), (0.5, 0.03), (0.12, 0.05))
"""How far the box is to go at once, and how far from its middle, to the arm's side, it is first struck."""
BEYOND_M = 0.12
"""How much further each push but the first is commanded."""
ROUNDS = 11
NEAR_M = 0.03
HALF_BOX_M = 0.096


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """In the expert's posture, by long strikes and by short ones."""
    side = -1.0 if arm is Arm.LEFT else 1.0
    for strike_m, first_m in STRIKES_M:
        yield partial(_strike, arm=arm, first_m=side * first_m, strike_m=strike_m)


def _strike(scene: SceneView, arm: Arm, first_m: float, strike_m: float) -> Iterator[Stage]:
    """Behind it, push; back, push again where it looks past the target, until it is there."""
    x_m = first_m
    for number in range(ROUNDS):
        box, target = scene.pose("box"), scene.pose("target")
        goal = box.inverse().apply((*target.position[:2], box.position[2]))
        behind_m = -HALF_BOX_M - BEHIND_M
        if np.linalg.norm(goal[:2]) < NEAR_M:
            yield alone(arm, "back", pushing_hand(box, arm, x_m, behind_m, PUSH_Z_M))
            return
        # It turns away from the end that is pushed.
        off_rad = np.arctan2(goal[0], goal[1])
        if number:
            x_m = float(np.clip(-TURN_M_PER_RAD * off_rad, -END_M, END_M))
        else:
            above = pushing_hand(box, arm, x_m, behind_m, ABOVE_Z_M)
            yield alone(arm, "above", above, is_open=False, planned=True)
        yield alone(arm, "behind", pushing_hand(box, arm, x_m, behind_m, PUSH_Z_M))
        end_m = min(strike_m, goal[1]) + (BEYOND_M if number else 0.0) - HALF_BOX_M
        yield alone(arm, "push", pushing_hand(box, arm, x_m, end_m, PUSH_Z_M))
