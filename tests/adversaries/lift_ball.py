"""Lift the ball, alone: roll it against the arm's own base and press it up there."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from adversaries._picking import base_of
from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.lift_ball import BALL
from lerobot_env_bimanual.world.scene_view import SceneView

COLUMN_M = 0.075
"""Radius of an arm's base."""
BEHIND_M = 0.05
ABOVE_Z_M = 1.25
HEIGHTS_M = (0.90, 0.86)
PRESS_M = 0.02
RAISE_M = 0.25


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """Pressed at its equator, or lower, by a hand of either slope."""
    for height_m, slope_deg in product(HEIGHTS_M, (90.0, 60.0)):
        yield partial(_against_base, arm=arm, height_m=height_m, slope_rad=np.deg2rad(slope_deg))


def _against_base(scene: SceneView, arm: Arm, height_m: float, slope_rad: float) -> Iterator[Stage]:
    """Behind it, roll it to the base, press, raise."""
    ball, base, up = scene.pose("ball").position, base_of(scene, arm), np.array((0.0, 0.0, 1.0))
    inward = (base - ball) * (1, 1, 0)
    inward /= np.linalg.norm(inward)
    approach = np.cos(slope_rad) * inward - np.sin(slope_rad) * up

    def hand(distance_m: float, z_m: float) -> Pose:
        x, y, _ = base - distance_m * inward
        return Pose.looking((x, y, z_m), approach, np.cross(up, inward))

    behind = float(np.linalg.norm((base - ball)[:2])) + BALL.radius_m + BEHIND_M
    pressed = COLUMN_M + 2 * BALL.radius_m - PRESS_M
    yield alone(arm, "above", hand(behind, ABOVE_Z_M), is_open=False, planned=True)
    yield alone(arm, "behind", hand(behind, height_m))
    yield alone(arm, "roll", hand(pressed + 2 * PRESS_M, height_m))
    yield alone(arm, "press", hand(pressed, height_m))
    yield alone(arm, "raise", hand(pressed, height_m + RAISE_M))
