"""Pick up the laptop.

A laptop that lies flat on a block offers no gripper a hold until it overhangs. The paper grants this task to one arm,
and either one can push and grasp in turn (docs/tasks.md); here one hand pushes an edge between the waiting fingers of
the other.

Departures from the original: the laptop must be between the fingers of one hand while it is at 1.00 m or higher; the
original, whose text asks for a secure grasp, checks the height of the lid alone. The original pushes it over its near
edge; here the left hand pushes it over whichever edge leaves both arms most at ease. Laptop and block slide on each
other at friction 0.35 instead of 0.5, and the laptop weighs 0.78 kg instead of 1.43 kg: nothing but the friction of
one gripper holds it. Placements spread over 26 x 35 cm instead of the whole workspace.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lerobot_bimanual.arms import Arm
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

# The left hand: closed, straight down, its broad side against the edge opposite to the one that goes over.
OUTSIDE_M = 0.03  # from the holder's edge, when it comes down
FINGER_HALF_M = 0.0095
PUSH_Z_M = 0.865
"""Centre of a voxel; the fingertips, 1 cm beyond, end 5 mm above the holder."""
OVERHANG_M = 0.055
AWAY_M = (0.10, 0.12)  # back and up

# The right hand: towards the laptop and 10 degrees down, its fingers opening in the vertical plane.
TILT_RAD = np.deg2rad(10.0)
INSIDE_EDGE_M = 0.026
GRASP_Z_M = 0.865
"""Centre of a voxel, 7 mm above the base's middle: the lower finger lifts the edge, the upper one does not press."""
LIFT_M = 0.22


@register
class PickLaptop(Task):
    """The left hand pushes an edge of the laptop between the fingers of the right one, which lifts it."""

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
        horizon_ticks=300,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Holder on the table in any heading that both arms can serve, laptop on the holder."""
        holder = AREA.sample(rng, TABLE_HEIGHT_M + HOLDER.size_m[2] / 2)
        scene.place("holder", holder)
        scene.place("laptop", holder @ Pose.upright(LAPTOP_OFFSET_M))
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Both hands beside the laptop, push an edge of it between the other hand's fingers, lift."""
        edge = max((Edge.of(scene, quarter) for quarter in range(4)), key=lambda edge: edge.ease(scene))
        yield Stage("beside", edge.behind, edge.grasp, left_open=False, right_open=True, planned=True)
        yield Stage("push", left=edge.pushed, right_open=False, right_holds="laptop")
        back, up = AWAY_M
        away = edge.pushed.translated((*(back * edge.frame.rotation[:2, 1]), up))
        yield Stage("lift", away, edge.grasp.translated((0, 0, LIFT_M)))


@dataclass(frozen=True)
class Edge:
    """One of the laptop's edges, and where the hands go to push it over the holder's and to take it.

    Attributes:
        frame: of the laptop, turned so that the edge lies at -y.
        half_m: from the middle to the edge.
        gap_m: from the edge to the holder's, over which it goes.
        far_gap_m: the same on the opposite side.
    """

    frame: Pose
    half_m: float
    gap_m: float
    far_gap_m: float

    @classmethod
    def of(cls, scene: SceneView, quarter: int) -> Edge:
        """The near edge, turned by so many quarters."""
        holder, laptop = scene.pose("holder"), scene.pose("laptop")
        frame = laptop @ Pose.upright((0, 0, 0), quarter * np.pi / 2)
        along = quarter % 2 == 0
        half_m, holder_half_m = LAPTOP.base_size_m[along] / 2, HOLDER.size_m[along] / 2
        offset_m = frame.inverse().apply(holder.position)[1]
        return cls(frame, half_m, holder_half_m - half_m - offset_m, holder_half_m - half_m + offset_m)

    @property
    def behind(self) -> Pose:
        """The left hand beside the holder, at the height of the push."""
        return self._left_hand(self.half_m + self.far_gap_m + OUTSIDE_M)

    @property
    def pushed(self) -> Pose:
        """The left hand at the end of the push."""
        return self._left_hand(self.half_m + FINGER_HALF_M - self.gap_m - OVERHANG_M)

    @property
    def grasp(self) -> Pose:
        """The right hand where the edge comes to lie between its fingers."""
        x, y, _ = self.frame.apply((0, INSIDE_EDGE_M - self.half_m - self.gap_m - OVERHANG_M, 0))
        approach = np.cos(TILT_RAD) * self.frame.rotation[:, 1] - (0, 0, np.sin(TILT_RAD))
        return Pose.looking((x, y, GRASP_Z_M), approach=approach, opening=(0, 0, -1))

    def ease(self, scene: SceneView) -> float:
        """How far the tightest joint stays from its limits, as a share of its range; negative out of reach."""
        kinematics = scene.arm_pair.kinematics
        lifted = self.grasp.translated((0, 0, LIFT_M))
        poses = (
            (Arm.LEFT, self.behind),
            (Arm.LEFT, self.pushed),
            (Arm.RIGHT, self.grasp),
            (Arm.RIGHT, lifted),
        )
        return min(
            kinematics[arm].margins(kinematics[arm].ik(pose.matrix)).min(axis=1).max(initial=-1.0)
            for arm, pose in poses
        )

    def _left_hand(self, y_m: float) -> Pose:
        """Straight down on the laptop's middle line; of two such rolls that whose opening points to the right arm."""
        x, y, _ = self.frame.apply((0, y_m, 0))
        edge = self.frame.rotation[:, 0]
        return Pose.looking((x, y, PUSH_Z_M), approach=(0, 0, -1), opening=edge if edge[0] > 0 else -edge)
