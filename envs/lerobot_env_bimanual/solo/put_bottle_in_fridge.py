"""Put the bottle in the fridge, alone: open the door, which stays open, then fetch the bottle."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.solo.ways import Way, alone
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks import put_bottle_in_fridge as expert
from lerobot_env_bimanual.world.scene_view import SceneView

FRIDGE = expert.FRIDGE


def ways(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Way]:
    """The hand's heading on the bar and on the bottle, and how far the door is opened."""
    for bring, pull, door in product((40.0, 20.0, 60.0, 0.0, 80.0), (50.0, 20.0, 80.0), (80.0, 60.0)):
        yield partial(
            _in_turn,
            arm=arm,
            bring_rad=np.deg2rad(bring),
            pull_rad=np.deg2rad(pull),
            door_rad=np.deg2rad(np.linspace(0, door, 5)),
        )


def _in_turn(scene: SceneView, arm: Arm, bring_rad: float, pull_rad: float, door_rad) -> Iterator[Stage]:
    """Open the door, back off, to the bottle, grasp, lift, before the fridge, insert, let go."""
    fridge, bottle = scene.pose("fridge"), scene.pose("bottle").position

    def pull(door: float):
        handle = fridge.apply(FRIDGE.handle(door, expert.HANDLE_Z_M - TABLE_HEIGHT_M))
        return expert.hand(handle, pull_rad + expert.TURN_SHARE * door)

    yield alone(arm, "before the bar", pull(0).advanced(-expert.BEFORE_HANDLE_M), is_open=True, planned=True)
    yield alone(arm, "grasp the bar", pull(0), is_open=False)
    for door in door_rad[1:-1]:
        yield alone(arm, "open", pull(door))
    yield alone(arm, "open", pull(door_rad[-1]), is_open=True)
    yield alone(arm, "back", pull(door_rad[-1]).advanced(-expert.AWAY_M))
    grasp = expert.hand((*bottle[:2], expert.GRASP_Z_M), bring_rad)
    via = expert.hand(expert.VIA_M, bring_rad)
    depth, aside = expert.RELEASE_M
    release = expert.hand(
        (*fridge.apply((FRIDGE.front_m + depth, aside, 0))[:2], expert.RELEASE_Z_M), bring_rad
    )
    before = release.translated(-expert.BEFORE_FRIDGE_M * expert.heading(bring_rad))
    yield alone(arm, "over the bottle", grasp.translated((0, 0, expert.ABOVE_BOTTLE_M)), planned=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds="bottle")
    yield alone(arm, "lift", grasp.translated((0, 0, expert.LIFT_M)))
    yield alone(arm, "via", via)
    yield alone(arm, "before the fridge", before)
    yield alone(arm, "insert", release, is_open=True)
    yield alone(arm, "leave", before)
