"""Put the bottle into the fridge, alone: drag the door ajar with the hand that has the bottle, hook it, and slip in."""

import math
from collections.abc import Iterator

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way, parameter_grid
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.put_bottle_in_fridge import FOLD_M, heading

PITCH_RAD = np.deg2rad(8.0)
GRASP_YAW_RAD = np.deg2rad(45.0)
HINGE_M = np.array([-0.126, -0.172])
DOOR_WIDTH_M = 0.344
FINGER_M = 0.032
HOOK_DEEP_M = 0.02
OPEN_DEG = 80.0


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """By the door's free edge below the bar, dragged nearer or further, or by friction on the bar's side."""
    return parameter_grid(_alone, arm=[arm], press_m=(0.045, 0.06), out_m=(0.12, 0.15), height_m=(0.40, 0.38))


def _alone(env: BimanualEnv, arm: Arm, press_m: float, out_m: float, height_m: float) -> Moves:
    hand, scene = Hand(env, arm), env.scene
    fridge, bottle = scene.pose("fridge"), scene.pose("bottle").position
    yaw_rad = math.atan2(*fridge.rotation[1::-1, 0])

    def pointing(position, yaw: float) -> Pose:
        ahead = np.cos(PITCH_RAD) * heading(yaw) - (0, 0, np.sin(PITCH_RAD))
        return Pose.looking(position, ahead, opening=heading(yaw + np.pi / 2))

    def at(x: float, y: float, z: float) -> Pose:
        return pointing((*fridge.apply((x, y, 0))[:2], TABLE_HEIGHT_M + z), yaw_rad)

    def door_deg() -> float:
        return float(np.rad2deg(scene.joint_value("fridge_hinge")))

    def hook() -> Pose:
        """Behind the inner corner of the door, some degrees ahead of it."""
        angle = np.deg2rad(min(max(door_deg(), 0.0) + 10.0, 100.0))
        x, y = HINGE_M + DOOR_WIDTH_M * np.array([-np.sin(angle), np.cos(angle)])
        return at(x + FINGER_M - 0.02 * np.cos(angle), y + FINGER_M - HOOK_DEEP_M, height_m)

    grasp = pointing((*bottle[:2], TABLE_HEIGHT_M + 0.035), GRASP_YAW_RAD)
    yield from hand.go(pointing(FOLD_M, GRASP_YAW_RAD))
    yield from hand.go(grasp.translated((0, 0, 0.15)))
    yield from hand.line(grasp)
    yield from hand.grip(0.0)
    yield from hand.line(grasp.translated((0, 0, 0.25)))
    yield from hand.go(pointing((0.15, 0.12, TABLE_HEIGHT_M + height_m), yaw_rad))
    yield from hand.line(at(-0.30, 0.265, height_m), 0.8)
    yield from hand.line(at(-0.125, 0.235, height_m), 0.6)
    yield from hand.line(at(-0.125, 0.235 - press_m, height_m), 0.3)
    yield from hand.line(at(-0.125 - out_m, 0.215 - press_m, height_m), 0.4)
    for _ in range(40):
        if door_deg() > OPEN_DEG:
            break
        yield from hand.servo(hook, 1)
    x, y, _ = fridge.inverse().apply(scene.tcp(arm).position)
    for target, speed_m_s, ticks in (
        (at(x + 0.10, y + 0.10, height_m), 1.2, 8),
        (at(-0.20, 0.04, 0.455), 1.2, 25),
        (at(-0.06, 0.02, 0.455), 0.6, 30),
    ):
        yield from hand.servo(lambda target=target: target, ticks, speed_m_s, 0.005)
    yield from hand.grip(1.0)
    yield from hand.line(at(-0.25, 0.02, 0.455), 0.6)
    yield from hand.hold(12)
