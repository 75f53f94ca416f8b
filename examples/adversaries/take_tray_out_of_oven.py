"""Take the tray out of the oven, alone: open the door, then reach in."""

from collections.abc import Iterator

import numpy as np

from adversaries.ways import Way, alone, parameter_grid, rehearsed
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.tasks import take_tray_out_of_oven as expert
from lerobot_env_bimanual.world.scene_view import SceneView

OVEN, TRAY = expert.OVEN, expert.TRAY


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """The hand may hold bar and tray either way round, and the bar anywhere along it."""
    either = (False, True)
    doors_rad = map(np.deg2rad, ((17, 34, 50), (15, 30)))
    places = {"handle_y_m": (-0.06, 0.0, 0.06), "door_rad": doors_rad}
    scripts = parameter_grid(_in_turn, arm=[arm], **places, bar_swapped=either, tray_swapped=either)
    return rehearsed(env, scripts)


def _in_turn(
    scene: SceneView, arm: Arm, handle_y_m: float, door_rad, bar_swapped: bool, tray_swapped: bool
) -> Iterator[Stage]:
    """Open the door, back off, wait until it is down, over to the tray, grasp, lift, out, raise."""
    oven = scene.pose("oven")

    def handle(door: float):
        return oven @ expert.hand(OVEN.handle(door, handle_y_m), expert.PITCH_SHARE * door, bar_swapped)

    yield alone(
        arm, "before the bar", handle(0).advanced(-expert.BEFORE_HANDLE_M), is_open=True, planned=True
    )
    yield alone(arm, "grasp the bar", handle(0), is_open=False)
    for door in door_rad[:-1]:
        yield alone(arm, "open", handle(door))
    yield alone(arm, "open", handle(door_rad[-1]), is_open=True)
    yield alone(arm, "back", handle(door_rad[-1]).advanced(-expert.BACK_M))
    near_m = expert.INSERT_M - expert.TRAY.size_m[0] / 2
    grasp = scene.pose("tray") @ expert.hand((near_m, 0, 0), fingers_swapped=tray_swapped)
    outside = (OVEN.front_m + expert.WAIT_M[0], 0, expert.WAIT_M[2])  # of the door's sweep, until it is down
    yield alone(arm, "wait", oven @ expert.hand(outside, fingers_swapped=tray_swapped))
    yield alone(arm, "before the tray", grasp.advanced(-expert.BEFORE_TRAY_M))
    yield alone(arm, "grasp", grasp, is_open=False, holds="tray")
    lifted = grasp.translated((0, 0, expert.LIFT_M))
    yield alone(arm, "lift", lifted)
    out = lifted.advanced(-expert.OUT_M)
    yield alone(arm, "take out", out)
    yield alone(arm, "raise", out.translated((0, 0, TABLE_HEIGHT_M + expert.RAISE_TO_M - out.position[2])))
