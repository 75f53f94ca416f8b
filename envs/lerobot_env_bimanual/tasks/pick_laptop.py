"""Pick up the laptop.

The paper says that one arm can do it, too. A laptop that lies flat on a block offers no gripper a hold: the left hand
pushes it over the block's edge, and the right hand reaches under it. One arm does both in turn (docs/tasks.md).

Departures from the original: the laptop must be between the fingers of one hand while it is at 1.00 m or higher;
the original, whose text asks for a secure grasp, checks the height of the lid alone. Laptop and block slide on
each other at friction 0.35 instead of 0.5, and the laptop weighs 0.78 kg instead of 1.43 kg: nothing but the
friction of one gripper holds it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Grasped
from lerobot_env_bimanual.placement import PlacementArea
from lerobot_env_bimanual.props.laptop import Laptop
from lerobot_env_bimanual.props.riser import Riser
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Prehension, Task, TaskSpec, Taxonomy, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

HOLDER = Riser("holder", size_m=(0.40, 0.30, 0.10))
LAPTOP = Laptop("laptop")
AREA = PlacementArea(center_m=(0.23, -0.075), half_size_m=(0.13, 0.175), half_yaw_rad=np.pi)
SUCCESS_HEIGHT_M = 1.00

LAPTOP_OFFSET_M = (-0.015, -0.019, (HOLDER.size_m[2] + LAPTOP.base_size_m[2]) / 2)
"""In the holder's axes: the near edge lies 4.5 mm inside the holder's (decoded from RLBench's task file)."""
EDGE_M = LAPTOP.base_size_m[1] / 2
"""From the laptop's middle to its near (-y) and far (+y) edge."""

# The left hand: closed, straight down, its broad side against the far edge.
BEHIND_M = 0.04
PUSH_M = 0.05
"""How far inside the far edge's old place the push ends."""
FINGER_HALF_M = 0.0095
ABOVE_Z_M = 0.935
PUSH_Z_M = 0.865
"""Centre of a voxel; the fingertips, 1 cm beyond, end 5 mm above the holder."""
CLEAR_Z_M = 0.965
ASIDE_M = 0.14
ASIDE_Z_M = 1.105

# The right hand: along +y of the laptop and 10 degrees down, its fingers opening in the vertical plane.
TILT_RAD = np.deg2rad(10.0)
WAIT_M = 0.10
WAIT_Z_M = 0.905
BEFORE_EDGE_M = 0.06
INSIDE_EDGE_M = 0.026
GRASP_Z_M = 0.865
"""Centre of a voxel, 7 mm above the base's middle: the lower finger lifts the edge, the upper one does not press."""
LIFT_M = 0.08
RAISE_M = 0.29


@register
class PickLaptop(Task):
    """The left hand pushes the laptop over the edge of its holder, the right hand grips the edge and lifts."""

    spec = TaskSpec(
        name="pick_laptop",
        id=7,
        instructions=("pick up the laptop",),
        variations=(Variation(),),
        taxonomy=Taxonomy(
            temporal=True,
            spatial=True,
            physical=True,
            symmetric=False,
            synchronous=False,
            prehension=Prehension.MIXED,
        ),
        props=(HOLDER, LAPTOP),
        success=(Grasped("laptop"), Above("laptop", SUCCESS_HEIGHT_M)),
        horizon_ticks=530,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Holder on the table in any heading that both arms can serve, laptop on the holder."""
        holder = AREA.sample(rng, TABLE_HEIGHT_M + HOLDER.size_m[2] / 2)
        scene.place("holder", holder)
        scene.place("laptop", holder @ Pose.upright(LAPTOP_OFFSET_M))
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Behind, down, push, reach for the edge where it really is, grasp, lift, raise."""
        laptop = scene.pose("laptop")
        nominal = laptop.translated(-(PUSH_M + FINGER_HALF_M) * laptop.rotation[:, 1])
        pushed = _left_hand(laptop, EDGE_M - PUSH_M, PUSH_Z_M)
        yield Stage(
            "behind",
            left=_left_hand(laptop, EDGE_M + BEHIND_M, ABOVE_Z_M),
            right=_right_hand(nominal, -EDGE_M - WAIT_M, WAIT_Z_M),
            left_open=False,
            right_open=True,
            planned=True,
        )
        yield Stage("down", left=_left_hand(laptop, EDGE_M + BEHIND_M, PUSH_Z_M))
        yield Stage("push", left=pushed)
        if scene.pose("laptop").distance_to(nominal)[0] < PUSH_M / 2:  # in a rehearsal nothing is pushed
            nominal = scene.pose("laptop")
        grasp = _right_hand(nominal, -EDGE_M + INSIDE_EDGE_M, GRASP_Z_M)
        yield Stage(
            "reach",
            left=pushed.translated((0, 0, CLEAR_Z_M - PUSH_Z_M)),
            right=_right_hand(nominal, -EDGE_M - BEFORE_EDGE_M, GRASP_Z_M),
        )
        aside = _left_hand(nominal, EDGE_M + ASIDE_M, ASIDE_Z_M)
        yield Stage("grasp", aside, grasp, right_open=False, right_holds="laptop")
        yield Stage("lift", right=grasp.translated((0, 0, LIFT_M)))
        yield Stage("raise", right=grasp.translated((0, 0, RAISE_M)))


def _left_hand(laptop: Pose, y_m: float, height_m: float) -> Pose:
    """Straight down at `y_m` on the laptop's middle line, fingers side by side along its edge.

    Of the two such rolls it is the one whose opening points towards the right arm.
    """
    x, y, _ = laptop.apply((0, y_m, 0))
    edge = laptop.rotation[:, 0]
    return Pose.looking((x, y, height_m), approach=(0, 0, -1), opening=edge if edge[0] > 0 else -edge)


def _right_hand(laptop: Pose, y_m: float, height_m: float) -> Pose:
    """Towards the far edge and a little down, at `y_m` on the laptop's middle line."""
    x, y, _ = laptop.apply((0, y_m, 0))
    approach = np.cos(TILT_RAD) * laptop.rotation[:, 1] - (0, 0, np.sin(TILT_RAD))
    return Pose.looking((x, y, height_m), approach=approach, opening=(0, 0, -1))
