"""Put the bottle in the fridge, alone.

Either the hand fetches the bottle first, pulls at the bar's lower end with the bottle's neck behind it, and slips in around
the door's edge; or it opens the door as usual, and the door shuts while it fetches the bottle.
"""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks import put_bottle_in_fridge as expert
from lerobot_env_bimanual.world.scene_view import SceneView

FRIDGE = expert.FRIDGE
HOOK_Z_M = 1.165
"""Of a hand below the bar, the bottle's neck behind it."""
BEHIND_BAR_M = 0.028
BESIDE_DOOR_M = 0.08
"""From the bar towards the door, and away from the hinge."""


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """The hand's heading on the bar and on the bottle, and how far the door is opened."""
    for bring, door in product((40.0, 20.0, 60.0, 0.0, 80.0), (85.0, 60.0)):
        yield partial(
            _hook, arm=arm, bring_rad=np.deg2rad(bring), door_rad=np.deg2rad(np.linspace(0, door, 5)[1:])
        )
    for bring, pull, door in product((40.0, 20.0, 60.0, 0.0, 80.0), (50.0, 20.0, 80.0), (80.0, 60.0)):
        yield partial(
            _in_turn,
            arm=arm,
            bring_rad=np.deg2rad(bring),
            pull_rad=np.deg2rad(pull),
            door_rad=np.deg2rad(np.linspace(0, door, 5)),
        )


def _hook(scene: SceneView, arm: Arm, bring_rad: float, door_rad: np.ndarray) -> Iterator[Stage]:
    """Fetch the bottle, its neck behind the bar, pull, around the door's edge, insert, let go."""
    fridge = scene.pose("fridge")

    def at(door: float, aside_m: float) -> Pose:
        turn = Pose.upright((0, 0, 0), door)
        bar = FRIDGE.handle(door, HOOK_Z_M - TABLE_HEIGHT_M)
        return expert.hand(fridge.apply(bar + turn.apply((BEHIND_BAR_M, aside_m, 0))), bring_rad)

    yield from _fetch(scene, arm, bring_rad)
    yield alone(arm, "beside the door", at(0.0, BESIDE_DOOR_M))
    yield alone(arm, "behind the bar", at(0.0, 0.0))
    for door in door_rad:
        yield alone(arm, "pull", at(door, 0.0))
    yield alone(arm, "around", at(door_rad[-1], BESIDE_DOOR_M))
    yield from _insert(scene, arm, bring_rad)


def _in_turn(
    scene: SceneView, arm: Arm, bring_rad: float, pull_rad: float, door_rad: np.ndarray
) -> Iterator[Stage]:
    """Open the door, back off, fetch the bottle, insert, let go."""
    fridge = scene.pose("fridge")

    def pull(door: float) -> Pose:
        handle = fridge.apply(FRIDGE.handle(door, expert.HANDLE_Z_M - TABLE_HEIGHT_M))
        return expert.hand(handle, pull_rad + expert.TURN_SHARE * door)

    yield alone(arm, "before the bar", pull(0).advanced(-expert.BEFORE_HANDLE_M), is_open=True, planned=True)
    yield alone(arm, "grasp the bar", pull(0), is_open=False)
    for door in door_rad[1:-1]:
        yield alone(arm, "open", pull(door))
    yield alone(arm, "open", pull(door_rad[-1]), is_open=True)
    yield alone(arm, "back", pull(door_rad[-1]).advanced(-expert.BEFORE_HANDLE_M))
    yield from _fetch(scene, arm, bring_rad)
    yield from _insert(scene, arm, bring_rad)


def _fetch(scene: SceneView, arm: Arm, bring_rad: float) -> Iterator[Stage]:
    """Over the bottle, grasp, lift."""
    x, y, _ = scene.pose("bottle").position
    grasp = expert.hand((x, y, expert.GRASP_Z_M), bring_rad)
    yield alone(
        arm, "over the bottle", grasp.translated((0, 0, expert.ABOVE_BOTTLE_M)), is_open=True, planned=True
    )
    yield alone(arm, "grasp", grasp, is_open=False, holds="bottle")
    yield alone(arm, "lift", grasp.translated((0, 0, expert.LIFT_M)))
    yield alone(arm, "via", expert.hand(expert.VIA_M, bring_rad))


def _insert(scene: SceneView, arm: Arm, bring_rad: float) -> Iterator[Stage]:
    """Before the fridge, in, let go, leave."""
    depth, aside = expert.RELEASE_M
    x, y, _ = scene.pose("fridge").apply((FRIDGE.front_m + depth, aside, 0))
    release = expert.hand((x, y, expert.RELEASE_Z_M), bring_rad)
    before = release.translated(-expert.BEFORE_FRIDGE_M * expert.heading(bring_rad))
    yield alone(arm, "before the fridge", before)
    yield alone(arm, "insert", release, is_open=True)
    yield alone(arm, "leave", before)
