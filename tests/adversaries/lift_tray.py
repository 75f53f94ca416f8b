"""Lift the tray, alone: pinch a long side, raise it, and press the board against the resting hand's fingertips.

Touched so, the other hand holds nothing: it does not close.
"""

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
from lerobot_env_bimanual.tasks.lift_tray import TRAY
from lerobot_env_bimanual.world.scene_view import SceneView

INSIDE_M = 0.024
ABOVE_MIDDLE_M = 0.006
BESIDE_M = 0.09
BELOW_M = 0.06
PRESS_M = 0.006
FINGERTIP_M = 0.010
"""From the tool centre point."""


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """The other fingers touch the board beyond the cube or before it; either roll of the hand."""
    for beyond_m, aside_m, roll in product((0.065, -0.065), (0.0, 0.08, -0.08), (1, -1)):
        yield partial(_touch_from_below, arm=arm, beyond_m=beyond_m, aside_m=aside_m, roll=roll)


def _touch_from_below(
    scene: SceneView, arm: Arm, beyond_m: float, aside_m: float, roll: int
) -> Iterator[Stage]:
    """Pinch, lift, carry below the other hand, up."""
    other = Arm.RIGHT if arm is Arm.LEFT else Arm.LEFT
    tray, up = scene.pose("tray"), np.array((0.0, 0.0, 1.0))
    out = tray.rotation[:, 0]
    if out @ (base_of(scene, arm) - tray.position) < 0:
        out = -out
    edge = tray.position + (TRAY.size_m[0] / 2 - INSIDE_M) * out + (0, 0, ABOVE_MIDDLE_M)
    grasp = Pose.looking(edge, -out, roll * up)
    resting = scene.tcp(other)
    tips = resting.position + FINGERTIP_M * resting.rotation[:, 2]
    # Level, its long side along the other hand's opening.
    along = resting.rotation[:, 1] * (1, 1, 0)
    along = along if along @ tray.rotation[:, 1] > 0 else -along
    flat = Pose.upright((0, 0, 0), np.arctan2(-along[0], along[1]))
    side = (
        1.0 if tray.rotation[:, 0] @ out > 0 else -1.0
    )  # the hand holds the board's side at this sign of its x axis
    middle = tips - flat.apply((-side * beyond_m, aside_m, 0)) - (0, 0, TRAY.size_m[2] / 2)
    yield alone(arm, "beside", grasp.advanced(-BESIDE_M), is_open=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds="tray")
    for name, below_m in (("carry", BELOW_M), ("up", -PRESS_M), ("press", -2 * PRESS_M)):
        in_hand = scene.tcp(arm).inverse() @ scene.pose("tray")
        target = Pose(middle - below_m * up, flat.quat_wxyz)
        yield alone(arm, name, target @ in_hand.inverse())
