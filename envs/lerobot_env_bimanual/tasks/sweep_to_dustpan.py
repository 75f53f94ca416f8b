"""Sweep the dirt into the dustpan.

One hand leads the broom while the other holds the pan that it sweeps into. The instruction names the dirt alone, but the pan
is light and glides: unless it is held, the first lumps that climb its lip push it away before the broom. The dirt must
be swept: no arm may touch it, and the pan may not be pushed under it. Strokes that stop before the pan roll the lumps in
without moving it, so the right hand has to hold the pan as long as any lump lies inside. One way remains: the right hand
sweeps the lumps into a row and stands the pan upright before it, in 3 of 12 scenes (docs/environment.md).

Departures from the original: broom and pan are real bodies, held by friction, and the pan is what has to contain the dirt,
wherever it stands. Broom and stand, and dirt and pan, are placed anew in each episode, the latter turned by up to 15
degrees; there they never move, so that a motion that ignores the scene would sweep every time. The broom is 35 cm high
instead of 60 and stands upright in a fork, and the hand holds its upper end from above. Lumps of dirt are 38 mm wide, to be
seen, instead of 10, round and of 15 g. Bristles and lip touch dirt alone, feet and gliders the table alone; all are thin or yield.

In the setting `varied` eleven numbers determine the keyposes. The dirt lies in two heaps, too far apart for one stroke: the
broom is led slantwise from behind either heap into the pan. Stands are turned, too, and brooms 33 to 37 cm high.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Always, Held, Inside, Near, NoneInside, Unhandled
from lerobot_env_bimanual.props.broom import Broom, BroomStand
from lerobot_env_bimanual.props.dustpan import Crumb, Dustpan, scattered
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

BROOM = Broom("broom", height_m=0.35)
STAND = BroomStand("stand")
PAN = Dustpan("dustpan")
CRUMBS = tuple(Crumb(f"dirt{index}") for index in range(5))
DIRT = tuple(crumb.name for crumb in CRUMBS)
STAND_AREA = PlacementArea(center_m=(0.07, 0.30), half_size_m=(0.08, 0.05))
DIRT_AREA = PlacementArea(center_m=(0.25, -0.02), half_size_m=(0.10, 0.04), half_yaw_rad=np.deg2rad(15.0))
"""The middle of the dirt; pan and sweep are turned with it."""
DIRT_HALF_M, PAN_Y_M = np.array([0.09675, 0.1356]), -0.25
"""How far crumbs lie from that middle, and the pan's offset from it (decoded from RLBench's task file)."""
VARIED_AREA = PlacementArea(center_m=(0.16, -0.03), half_size_m=(0.08, 0.04), half_yaw_rad=np.deg2rad(15.0))
HEAP_M, HEAP_HALF_M = ((0.12, 0.03), (0.125, 0.05)), np.array([0.03, 0.07])
"""In `varied`: range of the right heap's middle, from the dirt's middle; and how far crumbs lie from their heap's middle."""
VARIED_STAND_YAW_RAD = np.deg2rad(20.0)
VARIED_BROOMS = tuple(replace(BROOM, height_m=height_m) for height_m in (0.33, 0.35, 0.37))
CRUMB_DISTANCE_M = 0.055
"""Between two crumbs, so that no hand spans both."""
INSIDE_M = ((-0.132, -0.075, 0.0), (0.132, 0.075, 0.05))
"""The original's box, in the pan's axes, wider by as much as the pan is."""
MAX_SHIFT_M = 0.04  # of the pan, from where it was placed: it is swept into, not driven under the dirt

# The left hand: straight down on the stick, its fingers so that no sweep passes near a singularity.
ABOVE_M, BELOW_END_M = 0.095, 0.015
"""Heights above the grasp: of the approach, and of the stick's end. Centres of voxels, as in sweeps: rounding cancels out."""
TAKE_OUT_M = np.array([0.0, -0.075, 0.06])
FORK_Y_M, LEFT_END_M, LEFT_X_M = -0.035, (-0.125, 0.0, 0.0), -0.14
"""Strokes start before the fork, or the stick catches on a prong, and with the head's left end clear of the left arm's base."""
BEHIND_DIRT_M, BEHIND_SHARE, SWEEP_TO_M = 0.06, 0.2, 0.015
"""A sweep starts `BEHIND_DIRT_M` behind the last lump, plus `BEHIND_SHARE` of the heap's sideways distance from the middle of
the pan, and ends `SWEEP_TO_M` before that middle."""
TOWARDS_M, ACROSS_M = 0.05, 0.02
"""A slanting stroke starts square to the line to a point `TOWARDS_M` before the pan's middle. It ends `ACROSS_M` beyond the
middle, square to the pan, since the broom trails."""

# The right hand: from the side and slightly from above, on the pan's handle.
HOLD = Pose.looking((0, PAN.handle_y_m, 0.25), approach=(-1, 1, -0.25), opening=(1, 1, 0))
BEFORE_HANDLE_M = 0.09


@register
class SweepToDustpan(Task):
    """The left hand takes the broom and sweeps, the right hand holds the pan."""

    spec = TaskSpec(
        name="sweep_to_dustpan",
        id=9,
        instructions=(
            "sweep dirt to dustpan",
            "sweep the dirt up",
            "use the broom to brush the dirt into the dustpan",
            "clean up the dirt",
            "pick up the brush and clean up the table",
            "grasping the broom by its handle, clear way the dirt from the table",  # spelled like the original
            "leave the table clean",
            "sweep the dust to the pan",
        ),
        suites=("temporal", "spatial", "physical", "asymmetric", "asynchronous", "prehensile"),
        props=(STAND, BROOM, PAN, *CRUMBS),
        varied=tuple((STAND, broom, PAN, *CRUMBS) for broom in VARIED_BROOMS),
        success=(
            *(Inside(crumb, PAN.name, *INSIDE_M) for crumb in DIRT),
            Always((Unhandled(DIRT),)),
            Always((Near(PAN.name, MAX_SHIFT_M),)),
            Always((Held(PAN.name, by=Arm.RIGHT), NoneInside(DIRT, PAN.name, *INSIDE_M))),
        ),
        horizon_ticks=360,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Broom in its stand behind, pan in front, dirt scattered between them."""
        stand = STAND_AREA.sample(rng, TABLE_HEIGHT_M)
        dirt = (VARIED_AREA if scene.is_varied else DIRT_AREA).sample(rng, TABLE_HEIGHT_M)
        middles_m, half_m = np.zeros((len(CRUMBS), 2)), DIRT_HALF_M
        if scene.is_varied:
            stand @= Pose.upright((0, 0, 0), rng.uniform(-1, 1) * VARIED_STAND_YAW_RAD)
            heaps_m, half_m = rng.uniform(*HEAP_M, (2, 2)) * ((-1, 1), (1, 1)), HEAP_HALF_M
            middles_m = heaps_m[rng.permutation(np.append((0, 1, 0, 1), rng.integers(2)))]
        spots = scattered(rng, middles_m, half_m, CRUMB_DISTANCE_M)
        if spots is None:
            return False
        scene.place(STAND.name, stand)
        scene.place(BROOM.name, stand)
        scene.place(PAN.name, dirt @ Pose.upright((0.0, PAN_Y_M, 0.0)))
        for crumb, (x, y) in zip(CRUMBS, spots, strict=True):
            scene.place(crumb.name, dirt @ Pose.upright((x, y, crumb.radius_m)))
        return all(
            stand.inverse().apply(start.position)[1] < FORK_Y_M and start.apply(LEFT_END_M)[0] > LEFT_X_M
            for start, _ in _strokes(scene)
        )

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Approach, grasp both, take the broom out, carry it behind the dirt, lower, sweep."""
        broom, pan = scene.pose(BROOM.name), scene.pose(PAN.name)
        grip_m = (0, 0, scene.prop(Broom, BROOM.name).height_m - BELOW_END_M)
        grip = Pose.looking(grip_m, approach=(0, 0, -1), opening=(-1, 0, 0))
        grasp, hold = broom @ grip, pan @ HOLD
        yield Stage("approach", grasp.advanced(-ABOVE_M), hold.advanced(-BEFORE_HANDLE_M), planned=True)
        yield Stage(
            "grasp", grasp, hold, left_open=False, right_open=False, left_holds="broom", right_holds="dustpan"
        )
        yield Stage("take out", left=grasp.translated(broom.rotation @ TAKE_OUT_M))
        up, end = np.array([0, 0, TAKE_OUT_M[2]]), None
        for start, last in _strokes(scene):
            if end is not None:
                yield Stage("raise", left=end.translated(up))
            behind, end = start @ grip, last @ grip
            yield Stage("behind", left=behind.translated(up))
            yield Stage("lower", left=behind)
            yield Stage("sweep", left=end)


def _strokes(scene: SceneView) -> Iterator[tuple[Pose, Pose]]:
    """Start and end pose of the broom in each stroke, from the scene at the first: one stroke, or in `varied` one per heap."""
    pan = scene.pose(PAN.name)
    lumps_m = np.array([pan.inverse().apply(scene.pose(crumb.name).position)[:2] for crumb in CRUMBS])
    for side in (-1, 1) if scene.is_varied else (0,):
        heap_m = lumps_m[side * lumps_m[:, 0] >= 0]
        x_m = abs(side) * (heap_m[:, 0].min() + heap_m[:, 0].max()) / 2
        y_m = heap_m[:, 1].max() + BEHIND_DIRT_M + BEHIND_SHARE * abs(x_m)
        start = Pose.upright((x_m, y_m, 0.0), -math.atan2(x_m, y_m - TOWARDS_M))
        yield pan @ start, pan @ Pose.upright((-side * ACROSS_M, SWEEP_TO_M, 0.0))
