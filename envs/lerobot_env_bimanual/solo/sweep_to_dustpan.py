"""Sweep the dirt to the dustpan, alone: the pan stays where it is by its own weight."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.solo.ways import Way, alone
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks import sweep_to_dustpan as expert
from lerobot_env_bimanual.world.scene_view import SceneView

BROOM, PAN = expert.BROOM, expert.PAN


def ways(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Way]:
    """The hand comes from above on the broom's stick, or leans towards it."""
    for side, lean_rad in product((1, -1), np.deg2rad((0.0, 20.0, 40.0))):
        yield partial(_sweep, arm=arm, side=side, lean_rad=lean_rad)


def _sweep(scene: SceneView, arm: Arm, side: int, lean_rad: float) -> Iterator[Stage]:
    """Take the broom out of its stand, behind the dirt, sweep."""
    x, y, _ = scene.pose(BROOM.name).position
    pan = scene.pose(PAN.name)
    away = np.sign(0.27 - scene.arm_pair.base_poses[arm.ordinal].position[0]) * np.array((1.0, 0.0, 0.0))

    def hand(position, heading) -> Pose:
        approach = np.sin(lean_rad) * heading - (0, 0, np.cos(lean_rad))
        return Pose.looking(
            position, approach, side * (np.cos(lean_rad) * heading + (0, 0, np.sin(lean_rad)))
        )

    grasp = hand((x, y, expert.GRIP_Z_M), away)
    yield alone(arm, "above", grasp.advanced(-expert.ABOVE_M), is_open=True, planned=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds=BROOM.name)
    yield alone(arm, "take out", grasp.translated(expert.TAKE_OUT_M))

    def sweeping(y_m: float) -> Pose:
        x, y, _ = pan.apply((0.0, y_m, 0.0))
        return hand((x, y, expert.GRIP_Z_M), np.sign(away[0]) * pan.rotation[:, 0])

    behind = sweeping(expert.SWEEP_FROM_M)
    yield alone(arm, "behind", behind.translated((0, 0, expert.TAKE_OUT_M[2])))
    yield alone(arm, "lower", behind)
    yield alone(arm, "sweep", sweeping(0.0))
