"""Lift the tray.

The paper counts it among the tasks that one arm cannot do. Two hands grip the tray, which carries a loose cube, by
handles 37 cm apart, and rise together. One hand could pinch a long side and carry tray and cube level; it cannot make the
other hand grip the tray: the motor of that hand must do so.

Departures from the original: both hands must grip the tray while tray and cube are at 1.20 m or
higher; the original asks for the tray to be near both hands. The tray, a plain board there, has handles and
placements spread over 28 x 36 cm: on a board with a lip along its whole ends, a motion that ignores the scene
would succeed too often. The stand is 6 mm higher, which keeps the lower corner of a
horizontal hand off the table.

In the setting `varied` five numbers determine the keyposes: the tray's place and heading, its height, up to 10 cm more, and its
length, 30 to 38 cm. Its handles are 2 cm wide and 6 cm high, so that they nearly fill the open hand.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Held
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.serving_tray import PegStand, ServingTray
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

STAND = PegStand("stand", height_m=0.122)
TRAY = ServingTray("tray", mass_kg=0.45)
ITEM = Block("item", size_m=(0.04, 0.04, 0.04), mass_kg=0.064)
AREA = PlacementArea(center_m=(0.25, 0.02), half_size_m=(0.14, 0.18), half_yaw_rad=np.deg2rad(22.5))
SUCCESS_HEIGHT_M = 1.20

VARIED_SUNK_M = 0.10
VARIED_STAND = replace(STAND, height_m=STAND.height_m + VARIED_SUNK_M)
VARIED_LENGTHS_M = (0.30, 0.325, 0.355, 0.38)
VARIED_HANDLE: dict[str, Any] = {"handle_size_m": (0.02, 0.038), "handle_height_m": 0.06}

BESIDE_M, GRASP_M = 0.073, 0.030
"""Distance from the board's end to the tool centre points: the fingertips reach 23 mm over a handle."""
LIFT_TO_M = 1.265
"""Centre of a voxel, too."""
ASIDE_M, CLEAR_M = 0.07, 0.08
"""In the second plan the tray is first carried `ASIDE_M` to one side and to the other, `CLEAR_M` above its stand."""


@register
class LiftTray(Task):
    """Two horizontal hands pinch the handles and go up together."""

    spec = TaskSpec(
        name="lift_tray",
        id=10,
        instructions=("lift the tray",),
        suites=("temporal", "spatial", "physical", "symmetric", "synchronous", "prehensile"),
        props=(STAND, TRAY, ITEM),
        varied=tuple(
            (VARIED_STAND, replace(TRAY, size_m=(0.24, length_m, 0.006), **VARIED_HANDLE), ITEM)
            for length_m in VARIED_LENGTHS_M
        ),
        success=(
            Held("tray", by=Arm.LEFT),
            Held("tray", by=Arm.RIGHT),
            Above("tray", SUCCESS_HEIGHT_M),
            Above("item", SUCCESS_HEIGHT_M),
        ),
        horizon_ticks=160,
        needs_both_arms=True,
        plans=("straight up", "from side to side"),
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Stand on the table, tray on the stand, cube in the middle of the tray."""
        stand = AREA.sample(rng, TABLE_HEIGHT_M - (rng.uniform(0, VARIED_SUNK_M) if scene.is_varied else 0.0))
        tray = stand.translated((0, 0, scene.prop(PegStand, "stand").height_m + TRAY.size_m[2] / 2))
        scene.place("stand", stand)
        scene.place("tray", tray)
        scene.place("item", tray.translated((0, 0, (TRAY.size_m[2] + ITEM.size_m[2]) / 2)))
        return True

    def script(self, scene: SceneView, variation: Variation, plan: int = 0) -> Iterator[Stage]:
        """Go beside the tray, grasp it, lift it."""
        tray, half_m = scene.pose("tray"), scene.prop(ServingTray, "tray").size_m[1] / 2
        height_m = tray.position[2]
        beside, grasp = _hands(tray, half_m + BESIDE_M, height_m), _hands(tray, half_m + GRASP_M, height_m)
        yield Stage("beside", *beside, left_open=True, right_open=True, planned=True)
        yield Stage("grasp", *grasp, left_open=False, right_open=False, left_holds="tray", right_holds="tray")
        if plan:
            for aside_m in (-ASIDE_M, 2 * ASIDE_M):
                tray @= Pose.upright((0, aside_m, 0))
                yield Stage("aside", *_hands(tray, half_m + GRASP_M, height_m + CLEAR_M))
        yield Stage("lift", *_hands(tray, half_m + GRASP_M, LIFT_TO_M))


def _hands(tray: Pose, distance_m: float, height_m: float) -> tuple[Pose, Pose]:
    """Left and right hand facing each other along the tray's long axis, fingers one above the other."""
    along = tray.rotation[:, 1]

    def hand(side: int) -> Pose:
        x, y, _ = tray.position + side * distance_m * along
        return Pose.looking((x, y, height_m), approach=-side * along, opening=(0, 0, 1))

    return hand(1), hand(-1)
