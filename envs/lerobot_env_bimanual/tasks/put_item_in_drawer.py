"""Put the item in the bottom, middle or top drawer.

The paper requires that the item is placed inside the drawer, not that two arms are needed: the left arm alone can do
everything in turn (docs/environment.md). Here the left hand pulls the drawer open while the right hand picks the
item up from the cabinet's top, and holds it over the drawer as soon as that is open.

Departures from the original: the item must lie inside the drawer with no arm touching it; the original is satisfied
as soon as the item passes the drawer's volume, in the hand or not. The handle stands off by 40 mm, a brake of 0.6 N
and a damping of 2 N s/m keep a drawer where it was left (the original's slide freely), and cabinet and drawers pass
through each other, so that they never jam. The item falls 4 cm onto the drawer's floor. Placements spread over 40 x
24 cm, as far as both arms reach, instead of the whole workspace.

In the setting `varied` seven numbers determine the keyposes: the cabinet's place, heading and height (legs longer by up to
8 cm), and where on its top the item lies, and how it is turned. Handles are round knobs on rubber, 56 mm wide, and the item is
6 cm wide: both nearly fill the open hand.

A hand must have held the item: otherwise an arm that sweeps over the cabinet may push it off the top and pull the top drawer
open under it in one go.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Condition, Grasped, Inside, Once, Untouched
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.props.drawer_cabinet import LEVELS, DrawerCabinet
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

CABINET = DrawerCabinet("cabinet")
ITEM = Block("item", size_m=(0.04, 0.04, 0.04), mass_kg=0.064, rgba=(0.45, 0.45, 0.95, 1.0))
AREA = PlacementArea(center_m=(0.29, -0.14), half_size_m=(0.20, 0.12), half_yaw_rad=np.deg2rad(22.5))
CABINET_OFFSET_M = (0.025, -0.25)
"""Offset from the point that is drawn, about which the cabinet is turned, to its middle (decoded from RLBench's task file)."""
ITEM_OFFSET_M = (0.025, 0.10)
"""Position in the cabinet's axes."""

VARIED_RISE_M = 0.08
KNOB = {"handle_half_length_m": 0.002, "handle_radius_m": 0.028, "handle_gives_m": 0.012}
VARIED_CABINET = DrawerCabinet("cabinet", **KNOB, longer_legs_m=VARIED_RISE_M)
VARIED_ITEM = replace(ITEM, size_m=(0.06, 0.06, 0.04))
VARIED_AREA = PlacementArea(center_m=(0.34, -0.12), half_size_m=(0.14, 0.09), half_yaw_rad=np.deg2rad(22.5))
"""Nearer to the right arm, so that it reaches all of the top."""
VARIED_ITEM_M = ((-0.06, 0.02), (0.13, 0.14))
VARIED_YAW_RAD = np.deg2rad(30.0)

# The left hand: towards the front, its fingers above and below the bar.
BEFORE_HANDLE_M = 0.10
PULL_M = 0.23
AWAY_M = 0.03
ELBOW_ROOM_M = 0.03
"""Between the opened drawer and the left elbow, which may stand over it. (A rehearsal does not look at the forearm.)"""

# The right hand: straight down, its fingers side by side along the front.
HOVER_M, GRASP_M = 0.078, 0.018
"""Above the cabinet's top: in `standard` centres of voxels; the fingertips, 1 cm beyond, end 8 mm above it."""
DROP_OFFSET_M = (0.08, 0.11)
"""Offset from the middle of the drawer's handle before it is pulled, in the cabinet's axes."""
DROP_ABOVE_HANDLE_M = 0.02
DROP_TILT_RAD, VARIED_DROP_TILT_RAD = np.deg2rad(25.0), np.deg2rad(30.0)
"""The hand leans away from the cabinet, so that the forearm clears it."""


@register
class PutItemInDrawer(Task):
    """The left hand opens a drawer, the right hand fetches the item from the top and drops it in."""

    spec = TaskSpec(
        name="put_item_in_drawer",
        id=4,
        instructions=(
            "put the item in the {level} drawer",
            "put the block away in the {level} drawer",
            "open the {level} drawer and place the block inside of it",
            "leave the block in the {level} drawer",
        ),
        variations=tuple(Variation(index, {"level": level}) for index, level in enumerate(LEVELS)),
        suites=("temporal", "asymmetric", "asynchronous", "prehensile"),
        props=(CABINET, ITEM),
        varied=((VARIED_CABINET, VARIED_ITEM),),
        success=(*(Untouched("item", by=arm) for arm in ARMS), Once((Grasped("item"),))),
        horizon_ticks=420,
    )

    def conditions(self, variation: Variation) -> tuple[Condition, ...]:
        """Inside the drawer that the variation names, and released."""
        drawer = CABINET.drawer(variation.words["level"])
        return (Inside("item", drawer, *CABINET.drawer_inside), *self.spec.success)

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Cabinet on the table, opening towards +y, item on top of it."""
        area = VARIED_AREA if scene.is_varied else AREA
        cabinet = area.sample(rng, TABLE_HEIGHT_M) @ Pose.upright((*CABINET_OFFSET_M, 0))
        item_m, yaw_rad = ITEM_OFFSET_M, 0.0
        if scene.is_varied:
            cabinet = cabinet.translated((0, 0, rng.uniform(0, VARIED_RISE_M)))
            item_m, yaw_rad = rng.uniform(*VARIED_ITEM_M), rng.uniform(-1, 1) * VARIED_YAW_RAD
        scene.place("cabinet", cabinet)
        scene.place("item", cabinet @ Pose.upright((*item_m, CABINET.top_m + ITEM.size_m[2] / 2), yaw_rad))
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Approach, grasp both, pull, bring over, drop, withdraw."""
        cabinet, item = scene.pose("cabinet"), scene.pose("item")
        across, out = cabinet.rotation[:, 0], cabinet.rotation[:, 1]
        level = variation.words["level"]
        handle = cabinet.apply(CABINET.handle(level))
        bar = Pose.looking(handle, approach=-out, opening=(0, 0, 1))
        pulled = bar.translated(PULL_M * out)
        top_m = cabinet.position[2] + CABINET.top_m
        grasp_m = (*item.position[:2], top_m + GRASP_M)
        grasp = Pose.looking(grasp_m, approach=(0, 0, -1), opening=item.rotation[:, 0])
        hover = _at_height(grasp, top_m + HOVER_M)
        # For a rehearsal: opened further than it will be.
        opened = (f"{CABINET.drawer(level)}_slide", PULL_M + ELBOW_ROOM_M)
        x, y = np.add(DROP_OFFSET_M, (0, CABINET.handle(level)[1]))
        tilt_rad = VARIED_DROP_TILT_RAD if scene.is_varied else DROP_TILT_RAD
        down = (0, 0, -np.cos(tilt_rad)) - np.sin(tilt_rad) * out
        over = Pose.looking((*cabinet.apply((x, y, 0))[:2], top_m + HOVER_M), approach=down, opening=across)
        drop = _at_height(over, handle[2] + DROP_ABOVE_HANDLE_M)

        yield Stage("approach", bar.advanced(-BEFORE_HANDLE_M), hover, planned=True)
        yield Stage("grasp", bar, grasp, left_open=False, right_open=False, right_holds="item")
        yield Stage("pull", pulled, hover, left_open=True, turns=opened)
        yield Stage("bring", pulled.advanced(-AWAY_M), over)
        yield Stage("drop", right=drop, right_open=True)
        yield Stage("withdraw", right=over)


def _at_height(pose: Pose, height_m: float) -> Pose:
    return pose.translated((0, 0, height_m - pose.position[2]))
