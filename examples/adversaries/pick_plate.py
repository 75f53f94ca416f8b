"""Pick up the plate, alone: close a half-open hand on the rim; or push it over the table's edge, and pinch what hangs over."""

import math
from collections.abc import Iterator

import numpy as np

from adversaries.hand import Hand, Moves
from adversaries.ways import Way, parameter_grid
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.pick_plate import PLATE

OVER_EDGE_Y_M = -0.622
"""Of the plate's middle: its foot still stands on the table, which ends at -0.65."""
RIM_SLOPE_RAD = np.deg2rad(26.0)
INSIDE_RIM_M = 0.012
FINGER_M = 0.0125
PUSH_Z_M = TABLE_HEIGHT_M + 0.012
STEEP_RAD, DEEP_M = np.deg2rad(60.0), 0.014


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """The hand may be rolled either way round."""
    for way in (_grasp_rim_on_table, _over_the_edge):
        yield from parameter_grid(way, arm=[arm], roll=(1, -1))


def _grasp_rim_on_table(env: BimanualEnv, arm: Arm, roll: int) -> Moves:
    """Jam the lower finger between table and rim, with more force than a real arm allows itself, and close."""
    hand, plate = Hand(env, arm), env.scene.pose("plate")
    away, up = plate.rotation[:, 1], np.array([0.0, 0.0, 1.0])
    approach = -np.cos(STEEP_RAD) * away - np.sin(STEEP_RAD) * up
    height_m = PLATE.height_m - DEEP_M * math.tan(RIM_SLOPE_RAD)
    rim = plate.position + (PLATE.radius_m - DEEP_M) * away + height_m * up
    grasp = Pose.looking(rim, approach, roll * np.cross(np.cross(up, away), approach))
    yield from hand.grip(0.5, 1)
    yield from hand.go(grasp.advanced(-0.12))
    yield from hand.line(grasp, 0.3)
    yield from hand.grip(0.0, 12)
    yield from hand.line(grasp.translated(0.08 * up), 0.3)
    yield from hand.line(grasp.translated(0.34 * up), 0.5)
    yield from hand.hold(15)


def _over_the_edge(env: BimanualEnv, arm: Arm, roll: int) -> Moves:
    hand, scene = Hand(env, arm), env.scene

    def pushing(x: float, y: float) -> Pose:
        return Pose.looking((x, y, PUSH_Z_M), approach=(0, 0, -1), opening=(roll, 0, 0))

    def behind() -> Pose:
        """Behind the plate, pushing it towards -y and keeping it ahead."""
        plate = scene.pose("plate").position
        y = min(hand.commanded.position[1], plate[1] + PLATE.radius_m + 0.03) - 0.02
        return pushing(plate[0], max(y, OVER_EDGE_Y_M + PLATE.radius_m + FINGER_M - 0.01))

    x, y, _ = scene.pose("plate").position
    start = pushing(x, y + PLATE.radius_m + 0.035)
    yield from hand.grip(0.0, 1)
    yield from hand.go(start.translated((0, 0, 0.12)))
    yield from hand.line(start)
    for _ in range(150):
        if scene.pose("plate").position[1] < OVER_EDGE_Y_M:
            break
        yield from hand.servo(behind, 1, 0.35)
    back = pushing(scene.pose("plate").position[0], hand.commanded.position[1] + 0.04)
    yield from hand.line(back.translated((0, 0, 0.02)))
    yield from hand.line(back.translated((0.1, 0, 0.18)), 0.8)
    x, y, _ = scene.pose("plate").position
    height_m = TABLE_HEIGHT_M + PLATE.height_m - INSIDE_RIM_M * math.tan(RIM_SLOPE_RAD)
    away = -1.0 if arm is Arm.RIGHT else 1.0
    normal = (0, np.sin(RIM_SLOPE_RAD), np.cos(RIM_SLOPE_RAD))
    grasp = Pose.looking((x, y - PLATE.radius_m + INSIDE_RIM_M, height_m), (away, 0, 0), normal)
    before = grasp.translated((-0.16 * away, -0.06, 0))
    yield from hand.grip(1.0, 1)
    yield from hand.go(before.translated((0, -0.02, 0.12)))
    yield from hand.line(before, 0.6)
    yield from hand.line(grasp, 0.3)
    yield from hand.grip(0.0, 12)
    yield from hand.line(grasp.translated((0, -0.02, 0.10)), 0.3)
    yield from hand.line(grasp.translated((0, 0.05, 0.32)), 0.6)
    yield from hand.hold(15)
