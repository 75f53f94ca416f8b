"""Push the box to the red area.

The paper counts it among the tasks that one arm cannot do. The box of 50 kg slides on the table at friction 0.38, and
a single arm stalls at its torque limits unless it pushes at one end and then at the other, so that the box turns to and fro.
Therefore the box may never be turned by more than 12 degrees; with the expert it turns by 4. And both hands have to touch it at
the same time, as fingertips in the middle that push and lift, by joint targets found by search, move it alone (docs/environment.md).

The task needs more force than users of a real Panda set as a contact limit: 186 N to slide the box, 93 N from each hand,
and up to 175 N from one of them while the box gains speed. The motors can deliver it: the hands push with the outer sides
of their palms, 6 cm wide and straight in front of the wrists, and lean towards each other, so that the sixth joints, which
were saturated behind a flat hand, bear little of the force.

Departures from the original: friction is 0.38 instead of 0.5. The box's centre must come to rest in the 10 cm square at
the target's centre; the original is satisfied as soon as any part of the box touches that square, which a motion that
ignores the scene achieves too often. For the same reason boxes are turned by up to 20 degrees instead of 10; they lie in
20 x 25 cm. The hands are closed instead of open. An episode ends after 12.5 s.

In the setting `varied` six numbers determine the keyposes: the box's place and heading, its depth and width, and how far away
the red area is, 38 to 50 cm. The box's centre must come to rest within 2 cm of the target's.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Aligned, Always, AtRest, CentredOn, Once, Touched
from lerobot_env_bimanual.props.box import Box
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

BOX = Box("box", size_m=(0.384, 0.192, 0.128), mass_kg=50.0, table_friction=0.38)
TARGET = Target("target", size_m=(0.333, 0.198))
AREA = PlacementArea(center_m=(0.25, -0.17), half_size_m=(0.10, 0.125), half_yaw_rad=np.deg2rad(20.0))
TARGET_OFFSET_M = (0.021, 0.516)
"""Offset from the box to the target, in the box's axes (decoded from RLBench's task file)."""
TOLERANCE_M = 0.05
"""Half the side of the square in which the box's centre has to rest."""
VARIED_TOLERANCE_M = 0.02
VARIED_SIZES_M = ((0.384, 0.192), (0.34, 0.24), (0.30, 0.16), (0.36, 0.14), (0.32, 0.21))
VARIED_OFFSET_M = ((0.0, 0.38), (0.0, 0.50))
MAX_TURN_DEG = 12.0
"""Largest allowed angle between the headings of box and target at any time; they are equal at the start."""

# Hands in the box's axes: left of and right of its middle, closed, fingers down, an outer side of the palm to the front.
FROM_END_M = 0.052
"""From an end of the box to the middle of the palm that pushes beside it."""
LEAN_RAD = np.deg2rad(16.0)
"""Lean of the wrists towards each other: it shortens the lever between the pushing force and the axes of their sixth joints."""
TILT_RAD = np.deg2rad(-3.0)
"""Lean forwards, so that the palm's upper edge touches first, where that lever is shortest."""
PALM_M = 0.1034
"""Height of the palm's upper edge above the tool centre point."""
PALM_HALF_WIDTH_M = 0.1025
ABOVE_M = 0.017
TOUCH_M = 0.010
"""Distance of the palm's side from the box: a rounded keypose then neither strikes the box nor lands on it."""
PRESS_M = 0.010
"""Depth to which both hands press before they push: otherwise one hand would start the box alone, with 1 cm of run-up."""
ABOVE_Z_M = 0.985
PUSH_Z_M = 0.775
"""Centre of a voxel; fingertips a centimetre and a half above the table, the palm's side just below the box's top."""
LAG_M = 0.012
"""How far the hands lag behind their targets while they push."""
MIN_WORLD_Y_M = -0.494
"""Least y of a hand: outside the voxel grid, it would be rounded onto the box."""


@register
class PushBox(Task):
    """Two closed hands come down behind the box and push it to the far side."""

    spec = TaskSpec(
        name="push_box",
        id=0,
        instructions=("push the box to the red area",),
        suites=("temporal", "spatial", "symmetric", "synchronous", "non_prehensile"),
        props=(TARGET, BOX),
        varied=tuple((TARGET, replace(BOX, size_m=(*size_m, BOX.size_m[2]))) for size_m in VARIED_SIZES_M),
        success=(
            CentredOn("box", "target", TOLERANCE_M, VARIED_TOLERANCE_M),
            AtRest("box"),
            Always((Aligned("box", "target", MAX_TURN_DEG),)),
            Once(tuple(Touched("box", by=arm) for arm in ARMS)),
        ),
        horizon_ticks=250,
        needs_both_arms=True,
        plans=("one stroke", "two strokes"),
        load_bounds={"contact_force_n": 250.0},
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Box anywhere in the near half, the target at a fixed offset beyond it."""
        box = AREA.sample(rng, TABLE_HEIGHT_M + BOX.size_m[2] / 2)
        offset_m = rng.uniform(*VARIED_OFFSET_M) if scene.is_varied else TARGET_OFFSET_M
        scene.place("box", box)
        scene.place("target", box @ Pose.upright((*offset_m, -BOX.size_m[2] / 2)))
        return all(hand.position[1] > MIN_WORLD_Y_M for hand in _hands(scene, -ABOVE_M, ABOVE_Z_M))

    def script(self, scene: SceneView, variation: Variation, plan: int = 0) -> Iterator[Stage]:
        """Above, down, press, push."""
        way_m = scene.pose("box").inverse().apply(scene.pose("target").position)[1]
        above, down, press, push = (
            _hands(scene, -ABOVE_M, ABOVE_Z_M),
            _hands(scene, -TOUCH_M, PUSH_Z_M),
            _hands(scene, PRESS_M, PUSH_Z_M),
            _hands(scene, way_m + LAG_M, PUSH_Z_M),
        )
        halfway = _hands(scene, way_m / 2, PUSH_Z_M)
        yield Stage("above", *above, left_open=False, right_open=False, planned=True)
        yield Stage("down", *down)
        yield Stage("press", *press, presses="box")
        if plan:
            yield Stage("push halfway", *halfway, presses="box")
        yield Stage("push", *push)


def _hands(scene: SceneView, ahead_m: float, height_m: float) -> tuple[Pose, Pose]:
    """Both hands behind the box, near its ends, `ahead_m` in front of its back; see `pushing_hand`."""
    box, (x_m, y_m, _) = scene.pose("box"), np.divide(scene.prop(Box, "box").size_m, 2)
    return (
        pushing_hand(box, Arm.LEFT, FROM_END_M - x_m, ahead_m - y_m, height_m),
        pushing_hand(box, Arm.RIGHT, x_m - FROM_END_M, ahead_m - y_m, height_m),
    )


def pushing_hand(box: Pose, arm: Arm, x_m: float, y_m: float, height_m: float) -> Pose:
    """A hand whose palm's front side is at `x_m`, `y_m` in the box's axes, its tool centre point at `height_m` in the world."""
    outwards = -1.0 if arm is Arm.LEFT else 1.0
    lean = np.array([outwards * np.sin(LEAN_RAD), 0.0, -np.cos(LEAN_RAD)])
    sine, cosine = np.sin(TILT_RAD), np.cos(TILT_RAD)
    tilt = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    approach, front = tilt @ lean, tilt[:, 1]
    side = PALM_HALF_WIDTH_M * front - PALM_M * approach
    x, y, _ = box.apply((x_m - side[0], y_m - side[1], 0.0))
    return Pose.looking((x, y, height_m), box.rotation @ approach, outwards * box.rotation @ front)
