"""Put the item in the drawer, alone: open it, then fetch the item."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product

import numpy as np

from adversaries.ways import Way, alone, parameter_grid, rehearsed
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.tasks.put_item_in_drawer import BEFORE_HANDLE_M, CABINET, ITEM, PULL_M
from lerobot_env_bimanual.world.scene_view import SceneView

AWAY_M = 0.04
DROP_ABOVE_HANDLE_M = {"bottom": 0.16, "middle": 0.08, "top": 0.04}
ABOVE_Z_M = 1.34
BAR_PITCHES_RAD = np.deg2rad((0.0, 25.0))
ITEM_PITCHES_RAD = np.deg2rad((90.0, 60.0))
"""Of the hand below the horizontal; a tilted one reaches further."""


type Grip = Callable[[np.ndarray], Pose]
"""A hand that takes the item by two of its sides, by the position (3,) of its tool centre point."""


def grips(item: Pose, base_m: np.ndarray) -> Iterator[Grip]:
    """All grips of the item by its upright sides, steep ones first; then, to reach further, straight away from the arm's base."""
    across, along = item.rotation[:, 0], item.rotation[:, 1]
    away = (item.position - base_m) * (1, 1, 0)
    turned = product(ITEM_PITCHES_RAD, [across, along, -across, -along])
    for pitch, heading in (*turned, *product(ITEM_PITCHES_RAD, [away / np.linalg.norm(away)])):
        approach = np.cos(pitch) * heading - (0, 0, np.sin(pitch))
        yield partial(Pose.looking, approach=approach, opening=np.cross((0, 0, 1), heading))


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """The hand on the bar may be rolled and pitched, and on the item turned and pitched, as the arm likes it best."""
    item, base_m = env.scene.pose(ITEM.name), env.scene.arm_pair.base_pose(arm).position
    level = env.progress.variation.words["level"]
    of_bar = {"straight": (True, False), "pitch_rad": BAR_PITCHES_RAD, "side": (1, -1)}
    scripts = parameter_grid(_in_turn, arm=[arm], level=[level], **of_bar, grip=grips(item, base_m))
    return rehearsed(env, scripts)


def _in_turn(
    scene: SceneView, arm: Arm, level: str, straight: bool, pitch_rad: float, side: int, grip: Grip
) -> Iterator[Stage]:
    """Grasp the bar, pull, let go, withdraw, over the item, grasp, over the drawer, drop."""
    cabinet, up = scene.pose("cabinet"), np.array((0.0, 0.0, 1.0))
    out = cabinet.rotation[:, 1]
    handle = cabinet.apply(CABINET.handle(level))
    approach = -np.cos(pitch_rad) * out - np.sin(pitch_rad) * up
    bar = Pose.looking(handle, approach, opening=side * (np.cos(pitch_rad) * up - np.sin(pitch_rad) * out))
    yield alone(arm, "before the bar", bar.advanced(-BEFORE_HANDLE_M), is_open=True, planned=True)
    yield alone(arm, "grasp the bar", bar, is_open=False)
    pulled = bar.translated(PULL_M * out)
    yield alone(arm, "pull", pulled, is_open=True)
    away = pulled.advanced(-AWAY_M)
    yield alone(arm, "withdraw", away)
    grasp = grip(scene.pose(ITEM.name).position)
    if straight:
        yield alone(arm, "up", away.translated((0, 0, ABOVE_Z_M - away.position[2])))
    yield alone(arm, "before the item", grasp.advanced(-0.06), planned=not straight)
    yield alone(arm, "grasp", grasp, is_open=False, holds=ITEM.name)
    yield alone(arm, "lift", grasp.translated(0.06 * up))
    x, y, _ = cabinet.apply((0.0, CABINET.handle(level)[1] + PULL_M - 0.12, 0.0))
    over = grip((x, y, grasp.position[2] + 0.06))
    drop = grip((x, y, handle[2] + DROP_ABOVE_HANDLE_M[level]))
    yield alone(arm, "over the drawer", over)
    yield alone(arm, "drop", drop, is_open=True)
    yield alone(arm, "leave", over)
