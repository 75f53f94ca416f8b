"""Put the item in the drawer, alone: open it, then fetch the item."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.solo.ways import Way, alone
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.put_item_in_drawer import (
    BEFORE_HANDLE_M,
    CABINET,
    DROP_ABOVE_HANDLE_M,
    GRASP_Z_M,
    HOVER_Z_M,
    ITEM,
    PULL_M,
)
from lerobot_env_bimanual.world.scene_view import SceneView

AWAY_M = 0.12
TILTS_RAD = np.deg2rad((0.0, 20.0, 35.0))


def ways(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Way]:
    """The hand on the bar may be rolled and pitched, and on the item rolled, as the arm likes it best."""
    level = variation.words["level"]
    for pull_m, pitch, side, quarter in product((PULL_M, 0.17), (0.0, 25.0, 45.0), (1, -1), (0, 1, 2, 3)):
        yield partial(
            _in_turn, arm=arm, level=level, pull_m=pull_m, pitch=np.deg2rad(pitch), side=side, quarter=quarter
        )


def _in_turn(
    scene: SceneView, arm: Arm, level: str, pull_m: float, pitch: float, side: int, quarter: int
) -> Iterator[Stage]:
    """Grasp the bar, pull, let go, withdraw, over the item, grasp, over the drawer, drop."""
    cabinet = scene.pose("cabinet")
    across, out = cabinet.rotation[:, 0], cabinet.rotation[:, 1]
    up = np.array((0.0, 0.0, 1.0))
    handle = cabinet.apply(CABINET.handle(level))
    approach = -np.cos(pitch) * out - np.sin(pitch) * up
    bar = Pose.looking(handle, approach, opening=side * (np.cos(pitch) * up - np.sin(pitch) * out))
    yield alone(arm, "before the bar", bar.advanced(-BEFORE_HANDLE_M), is_open=True, planned=True)
    yield alone(arm, "grasp the bar", bar, is_open=False)
    pulled = bar.translated(pull_m * out)
    yield alone(arm, "pull", pulled, is_open=True)
    yield alone(arm, "withdraw", pulled.advanced(-AWAY_M))
    item = scene.pose(ITEM.name)
    turn = quarter * np.pi / 2
    down = partial(Pose.looking, approach=(0, 0, -1), opening=np.cos(turn) * across + np.sin(turn) * out)
    grasp = down((*item.position[:2], GRASP_Z_M))
    hover = down((*item.position[:2], HOVER_Z_M))
    yield alone(arm, "over the item", hover, planned=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds=ITEM.name)
    yield alone(arm, "lift", hover)
    x, y, _ = cabinet.apply((0.0, CABINET.handle(level)[1] + pull_m - 0.12, 0.0))
    over = down((x, y, HOVER_Z_M))
    drop = down((x, y, handle[2] + DROP_ABOVE_HANDLE_M[level]))
    yield alone(arm, "over the drawer", over)
    yield alone(arm, "drop", drop, is_open=True)
    yield alone(arm, "leave", over)
