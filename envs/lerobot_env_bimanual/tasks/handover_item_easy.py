"""Hand over the item.

The paper asks that the item be securely grasped and lifted to 80 cm while the other arm is idle. The left arm picks it
up and presents it, the right arm takes hold of it while the left one still holds it. The item lies where the left arm
reaches it and, in `standard`, no posture of the right one touches it, so that the left arm has to bring it. Both hands must
have held it at the same time: an item that is put down and picked up again was not handed over.

Departures from the original: the item lies on the left arm's side of the table, beyond the right one's reach; there
the receiver could pick it up itself in most places. It is 6 cm wide instead of 4 cm and is turned by up to 44 degrees instead of
22.5, so that the open hand, 8 cm wide, has a centimetre to spare on either side. The right hand must have closed its fingers
on the item, at 0.80 m or higher, with no part of the left arm touching it; in the original the item has to be near the right
fingers and not near the left ones. Both hands present rolled by 45 degrees, so that their fingers cross at a right angle and never meet.

In the setting `varied` five numbers determine the keyposes: the item's place and heading, the height of the pedestal under it,
up to 15 cm, and its own, 7 to 10 cm. It is 5.5 to 6.5 cm wide and nearly fills the open hand, whose fingers come down in slots
between walls.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Held, Once, Untouched
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.pedestal import Pedestal
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks._handover import draw_place, hand_over
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

ITEM = Block("item", size_m=(0.06, 0.06, 0.08), mass_kg=0.128)
HALF_YAW_RAD = np.deg2rad(44.0)
MIN_RIGHT_REACH_M = 0.995
"""Least distance of the item's middle from the right base: a corner may be 4.2 cm nearer; the fingers reach 0.95 m at most."""
SUCCESS_HEIGHT_M = 0.80

VARIED_SIZES_M = ((0.065, 0.08), (0.060, 0.10), (0.065, 0.07), (0.055, 0.09))
"""Width and height."""
VARIED_HEIGHT_M = 0.15
SLOT_HALF_M, WALL_X_M, WALL_SIZE_M, WALL_ABOVE_MIDDLE_M = 0.018, 0.052, (0.024, 0.05), 0.045
"""Each finger comes down in a slot between two walls, which end `WALL_ABOVE_MIDDLE_M` above the item's middle."""

LEFT_BEHIND_M = 0.025
RIGHT_BEHIND_M = 0.020
"""How far the tool centre points stop short of the item's centre: 4.5 cm apart, palms 12 cm apart."""


def _varied(size_m: tuple[float, float]) -> tuple[Block, Pedestal]:
    width_m, height_m = size_m
    top_m, y_m = height_m / 2 + WALL_ABOVE_MIDDLE_M, SLOT_HALF_M + WALL_SIZE_M[1] / 2
    walls = tuple(
        (side_x * WALL_X_M, side_y * y_m, *WALL_SIZE_M, top_m) for side_x in (-1, 1) for side_y in (-1, 1)
    )
    stand = Pedestal("stand", (0.09, 0.09), VARIED_HEIGHT_M, walls_m=walls)
    return replace(ITEM, size_m=(width_m, width_m, height_m)), stand


@register
class HandoverItemEasy(Task):
    """The left hand picks the block up and presents it, the right hand takes it."""

    spec = TaskSpec(
        name="handover_item_easy",
        id=11,
        instructions=("bring me the item", "hand over the object", "hand over the item"),
        suites=("temporal", "spatial", "physical", "asymmetric", "asynchronous", "prehensile"),
        props=(ITEM,),
        varied=tuple(map(_varied, VARIED_SIZES_M)),
        success=(
            Held("item", by=Arm.RIGHT),
            Untouched("item", by=Arm.LEFT),
            Above("item", SUCCESS_HEIGHT_M),
            Once((Held("item", by=Arm.LEFT), Held("item", by=Arm.RIGHT))),
        ),
        horizon_ticks=280,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Item upright beyond the right arm's reach."""
        stand_m = rng.uniform(0, VARIED_HEIGHT_M) if scene.is_varied else 0.0
        right_m = scene.arm_pair.base_pose(Arm.RIGHT).position

        def is_free(foot: Pose) -> bool:
            return bool(np.linalg.norm((foot.position - right_m)[:2]) >= MIN_RIGHT_REACH_M)

        foot = draw_place(scene, rng, TABLE_HEIGHT_M + stand_m, HALF_YAW_RAD, is_free)
        if foot is None:
            return False
        if scene.is_varied:
            scene.place("stand", foot)
        scene.place("item", foot.translated((0, 0, scene.prop(Block, "item").size_m[2] / 2)))
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Pick up, present, receive, release, withdraw."""
        yield from hand_over(scene, "item", LEFT_BEHIND_M, RIGHT_BEHIND_M)
