"""Sweep the dirt to the dustpan, alone: lump by lump, with broom or hand and no hand at the pan, or with the pan as a shovel."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from adversaries._picking import base_of
from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks import sweep_to_dustpan as expert
from lerobot_env_bimanual.world.scene_view import SceneView

BROOM, PAN, CRUMBS = expert.BROOM, expert.PAN, expert.CRUMBS
LEANS_RAD = np.deg2rad((0.0, 20.0, 40.0))
OVER_PAN_M, HOVER_M = 0.10, 0.08
PINCH_Z_M = TABLE_HEIGHT_M + 0.015
STROKES_M = (-0.07, 0.0, 0.07)
"""From the pan's middle to the sides; the spread fingers are 10 cm wide."""
FLICK_TO_M = 0.14
"""From the pan's middle: the broom stops in front of the lip, and the dirt goes on."""
AGAINST_BROOM_M = 0.09
"""From the broom to the pan's middle, when the lip is under the bristles."""


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """Each kind of strategy, the hand straight down or leaning away from the arm."""
    sweep, flick = (partial(_sweep, stop_m=stop_m) for stop_m in (expert.SWEEP_TO_M, FLICK_TO_M))
    kinds = (_pick_up, sweep, _brush, _shovel, flick)
    for lean_rad, side, kind in product(LEANS_RAD, (1, -1), kinds):
        yield partial(kind, arm=arm, side=side, lean_rad=lean_rad)


def _pick_up(scene: SceneView, arm: Arm, side: int, lean_rad: float) -> Iterator[Stage]:
    """Take one lump after the other, straight from the pan and straight back, and drop it there."""
    opening, away = scene.pose(PAN.name).rotation[:, 0], _away(scene, arm)
    for number, crumb in enumerate(CRUMBS):
        x, y, _ = scene.pose(crumb.name).position
        pinch = _hand((x, y, PINCH_Z_M), opening * np.sign(opening @ away), side, lean_rad)
        if number == 0:
            yield alone(arm, "above", pinch.advanced(-HOVER_M), is_open=True, planned=True)
        yield alone(arm, "pinch", pinch, is_open=False, holds=crumb.name)
        drop = scene.pose(PAN.name).apply((0.0, 0.0, OVER_PAN_M))
        yield alone(arm, "drop", pinch.translated(drop - pinch.position), is_open=True)


def _sweep(scene: SceneView, arm: Arm, side: int, lean_rad: float, stop_m: float) -> Iterator[Stage]:
    """Take the broom out of its stand, behind the dirt, sweep to `stop_m` before the pan's middle."""
    x, y, _ = scene.pose(BROOM.name).position
    pan, away = scene.pose(PAN.name), _away(scene, arm)
    grasp = _hand((x, y, expert.GRIP_Z_M), away, side, lean_rad)
    yield alone(arm, "above", grasp.advanced(-expert.ABOVE_M), is_open=True, planned=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds=BROOM.name)
    yield alone(arm, "take out", grasp.translated(expert.TAKE_OUT_M))

    def sweeping(y_m: float) -> Pose:
        x, y, _ = pan.apply((0.0, y_m, 0.0))
        return _hand((x, y, expert.GRIP_Z_M), np.sign(away[0]) * pan.rotation[:, 0], side, lean_rad)

    behind = sweeping(expert.SWEEP_FROM_M)
    yield alone(arm, "behind", behind.translated((0, 0, expert.TAKE_OUT_M[2])))
    yield alone(arm, "lower", behind)
    yield alone(arm, "sweep", sweeping(stop_m))


def _brush(scene: SceneView, arm: Arm, side: int, lean_rad: float) -> Iterator[Stage]:
    """Sweep with the spread fingers, stroke beside stroke."""
    pan, away = scene.pose(PAN.name), _away(scene, arm)

    def brushing(x_m: float, y_m: float) -> Pose:
        x, y, _ = pan.apply((x_m, y_m, 0.0))
        return _hand((x, y, PINCH_Z_M), np.sign(away[0]) * pan.rotation[:, 0], side, lean_rad)

    for stroke_m in STROKES_M:
        behind = brushing(stroke_m, expert.SWEEP_FROM_M)
        yield alone(arm, "behind", behind.translated((0, 0, HOVER_M)), is_open=True)
        yield alone(arm, "lower", behind)
        yield alone(arm, "brush", brushing(stroke_m, expert.SWEEP_TO_M))
        yield alone(arm, "raise", brushing(stroke_m, expert.SWEEP_TO_M).translated((0, 0, HOVER_M)))


def _shovel(scene: SceneView, arm: Arm, side: int, lean_rad: float) -> Iterator[Stage]:
    """Take the pan by its handle, drive it under the dirt, and push what it drives before it against the standing broom."""
    pan, away = scene.pose(PAN.name), _away(scene, arm)
    hold = _hand(pan.apply((0.0, PAN.handle_y_m, PAN.height_m - 0.015)), away, side, lean_rad)
    yield alone(arm, "above", hold.advanced(-HOVER_M), is_open=True, planned=True)
    yield alone(arm, "hold", hold, is_open=False, holds=PAN.name)
    to_hand = pan.inverse() @ hold
    dirt = pan.apply((0.0, -expert.PAN_Y_M, 0.0))
    broom = scene.pose(BROOM.name).position
    heading = (broom - dirt) * (1, 1, 0)
    yaw = np.arctan2(-heading[0], heading[1])
    heading /= np.linalg.norm(heading)
    through = Pose.upright(dirt + 0.05 * heading, yaw)
    yield alone(arm, "drive", through @ to_hand)
    yield alone(arm, "against the broom", Pose.upright(broom - AGAINST_BROOM_M * heading, yaw) @ to_hand)


def _away(scene: SceneView, arm: Arm) -> np.ndarray:
    """(3,) the direction along x that leads away from where the arm stands."""
    return np.array((np.sign(0.27 - base_of(scene, arm)[0]), 0.0, 0.0))


def _hand(position, heading: np.ndarray, side: int, lean_rad: float) -> Pose:
    """A hand that points down, leaning towards `heading` (3,); its fingers open along that."""
    approach = np.sin(lean_rad) * heading - (0, 0, np.cos(lean_rad))
    return Pose.looking(position, approach, side * (np.cos(lean_rad) * heading + (0, 0, np.sin(lean_rad))))
