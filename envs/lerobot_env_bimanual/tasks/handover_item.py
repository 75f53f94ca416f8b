"""Hand over the item of the named colour.

The paper asks that the right item be securely grasped and lifted to 80 cm while the other arm is idle. The left arm picks
it up and presents it, the right arm takes hold of it while the left one still holds it. All items lie where the left arm
reaches them and, in `standard`, no posture of the right one touches them, so that the left arm has to bring the right one
its item. Both hands must have held it at the same time: an item that is put down and picked up again was not handed over.

Departures from the original: items lie on the left arm's side of the table, beyond the right one's reach; there the
receiver could pick most of them up itself. The right hand must have closed its fingers on the right item, at 0.80 m
or higher, with no part of the left arm touching any item, as the paper's text says; the original asks for the item
near the right fingers and not near the left ones. Items lie 6 cm apart instead of 5 cm, and the one to hand over
leaves room for the fingers beside it.

In the setting `varied` the items are 5.2 cm wide and stand on pedestals up to 8 cm high: place and heading of the named item
decide, and the places of the others; its height little, as hands sent to pedestals of 3.4 cm solve 28 of 30 scenes.

Without the instruction the item can be guessed in 42 of 100 scenes, 39 in `varied`: only the one to hand over is sure to have
room for the fingers.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Held, Once, Untouched
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.pedestal import Pedestal
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Script, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks._handover import draw_place, grasp_axis, hand_over
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

COLORS = {
    "red": (1.0, 0.0, 0.0, 1.0),
    "green": (0.0, 1.0, 0.0, 1.0),
    "blue": (0.0, 0.0, 1.0, 1.0),
    "yellow": (1.0, 1.0, 0.0, 1.0),
    "purple": (0.5, 0.0, 0.5, 1.0),
}
SIDE_M = 0.04
ITEMS = tuple(f"item{index}" for index in range(len(COLORS)))
"""The first one is to be handed over: it gets the variation's colour, the others share the remaining ones."""
TARGET = ITEMS[0]
SUCCESS_HEIGHT_M = 0.80

VARIED_SIDE_M = 0.052
STANDS = tuple(Pedestal(f"stand{index}", (0.05, 0.05), depth_m=0.08) for index in range(len(COLORS)))
VARIED_HEIGHT_M = 0.08
"""Greatest height of the pedestals, all equally high, so that palm and fingers stay above everything beside an item."""

MIN_DISTANCE_SIDES = 1.5
"""Between the centres of two items, over their width; they never touch."""
FINGERS_M = np.array([0.065, 0.015])
"""Half of what the open fingers of a hand pointing down take up, along and across their opening."""
LEFT_BEHIND_M = 0.005
RIGHT_BEHIND_M = 0.005
"""How far the tool centre points stop short of the item's centre: 1 cm apart, palms 8.3 cm apart."""


def _blocks(side_m: float) -> tuple[Block, ...]:
    return tuple(Block(item, size_m=(side_m, side_m, side_m), mass_kg=0.064) for item in ITEMS)


@register
class HandoverItem(Task):
    """The left hand picks the item of the right colour up and presents it, the right hand takes it."""

    spec = TaskSpec(
        name="handover_item",
        id=6,
        instructions=(
            "bring me the {color} item",
            "hand over the {color} object",
            "hand over the {color} item",
        ),
        variations=tuple(Variation(index, {"color": color}) for index, color in enumerate(COLORS)),
        suites=("temporal", "spatial", "physical", "asymmetric", "synchronous", "prehensile"),
        props=_blocks(SIDE_M),
        varied=((*_blocks(VARIED_SIDE_M), *STANDS),),
        success=(
            Held(TARGET, by=Arm.RIGHT),
            Above(TARGET, SUCCESS_HEIGHT_M),
            *(Untouched(item, by=Arm.LEFT) for item in ITEMS),
            Once((Held(TARGET, by=Arm.LEFT), Held(TARGET, by=Arm.RIGHT))),
        ),
        horizon_ticks=300,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Items beyond the right arm's reach, none where the left fingers close around the one to hand over."""
        placed: list[Pose] = []
        side_m = scene.prop(Block, TARGET).size_m[0]
        stand_m = rng.uniform(0, VARIED_HEIGHT_M) if scene.is_varied else 0.0

        def is_free(pose: Pose) -> bool:
            apart = all(
                np.hypot(*(pose.position - other.position)[:2]) >= MIN_DISTANCE_SIDES * side_m
                for other in placed
            )
            return apart and not (placed and _between_fingers(pose, placed[0], side_m))

        color = variation.words["color"]
        colors = (color, *rng.permutation([name for name in COLORS if name != color]))
        for item, stand, name in zip(ITEMS, STANDS, colors, strict=True):
            pose = draw_place(scene, rng, TABLE_HEIGHT_M + stand_m + side_m / 2, np.pi, is_free)
            if pose is None:
                return False
            placed.append(pose)
            scene.place(item, pose)
            if scene.is_varied:
                scene.place(stand.name, pose.translated((0, 0, -side_m / 2)))
            scene.set_color(item, COLORS[name])
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Pick up, present, receive, release, withdraw."""
        yield from hand_over(scene, TARGET, LEFT_BEHIND_M, RIGHT_BEHIND_M)

    def script_for_instruction(self, scene: SceneView, variation: Variation) -> Script | None:
        """Hand over the item of the named colour, whichever it is."""
        named = [item for item in ITEMS if scene.has_color(item, COLORS[variation.words["color"]])]
        margins = {"left_behind_m": LEFT_BEHIND_M, "right_behind_m": RIGHT_BEHIND_M}
        return partial(hand_over, item=named[0], **margins) if named else None


def _between_fingers(other: Pose, target: Pose, side_m: float) -> bool:
    """Whether another item, at any yaw, may be where the left fingers close around the target."""
    along = grasp_axis(target)
    across = np.array([-along[1], along[0], 0.0])
    offset = np.abs(np.stack([along, across]) @ (other.position - target.position))
    return bool((offset < FINGERS_M + side_m / np.sqrt(2)).all())
