"""Pick up the laptop.

A laptop that lies flat on a block offers no gripper a hold until it overhangs. According to the paper, one arm can do
this task, and either one can push and grasp in turn (docs/environment.md); here one hand pushes an edge between the waiting
fingers of the other.

Departures from the original: the laptop must be between the fingers of one hand while it is at 1.00 m or higher; the
original, whose text asks for a secure grasp, checks the height of the lid alone. The original pushes it over its near
edge; here the left hand pushes it over the edge that keeps both arms furthest from their joint limits. The laptop slides on
block and rubber at friction 0.35 instead of 0.5, so that a hand that comes down on the lid does not drag it along, and weighs
0.78 kg instead of 1.43 kg: one gripper alone holds it. It lies anywhere on the block, where the original's is 4.5 mm inside the
near edge. Placements spread over 31 x 40 cm instead of the whole workspace.

In the setting `varied` eight numbers determine the keyposes: the block's place, heading and height, 8 to 16 cm, the laptop's
length and width, and where it lies on the block. It is 5 cm thick, so that it nearly fills the open hand.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Grasped
from lerobot_env_bimanual.props.laptop import Laptop, Riser
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

HOLDER = Riser("holder", size_m=(0.40, 0.30, 0.10))
LAPTOP = Laptop("laptop")
AREA = PlacementArea(center_m=(0.23, -0.075), half_size_m=(0.155, 0.20), half_yaw_rad=np.pi)
SUCCESS_HEIGHT_M = 1.00

VARIED_HEIGHTS_M = (0.08, 0.112, 0.096, 0.128, 0.16, 0.144)
VARIED_SIZES_M = ((0.347, 0.253), (0.315, 0.23), (0.347, 0.22), (0.30, 0.253), (0.33, 0.24), (0.36, 0.23))
VARIED_THICKNESS_M = 0.048

NEAR_M = 0.10
"""From here both hands come straight: which edge is meant, and where it lies, may be seen from where they wait."""

# The left hand: closed, straight down, its broad side against the edge opposite to the one that goes over.
BEHIND_M = 0.010  # the laptop's edge, when it comes down
FINGER_HALF_M = 0.0095
PUSH_ABOVE_HOLDER_M = 0.015
"""In `standard` the centre of a voxel; the fingertips, 1 cm beyond, end 5 mm above the holder."""
OVERHANG_M = 0.045
AWAY_M = (0.10, 0.12)  # back and up

# The right hand: towards the laptop and 10 degrees down, its fingers opening in the vertical plane.
TILT_RAD = np.deg2rad(10.0)
INSIDE_EDGE_M = 0.026
GRASP_ABOVE_MIDDLE_M, VARIED_ABOVE_MIDDLE_M = 0.0073, 0.004
"""In `standard` the centre of a voxel: the lower finger lifts the edge, the upper one does not press."""
LIFT_M = 0.22

type Way = tuple[tuple[Pose, ...], tuple[Pose, ...]]
"""Where the left and the right hand go to push one of the laptop's edges over the holder's and to take it."""


def _varied(height_m: float, size_m: tuple[float, float]) -> tuple[Riser, Laptop]:
    lid_m = (size_m[0] - 0.007, size_m[1] - 0.008, LAPTOP.lid_size_m[2])
    laptop = replace(LAPTOP, base_size_m=(*size_m, VARIED_THICKNESS_M), lid_size_m=lid_m)
    return replace(HOLDER, size_m=(*HOLDER.size_m[:2], height_m)), laptop


@register
class PickLaptop(Task):
    """The left hand pushes an edge of the laptop between the fingers of the right one, which lifts it."""

    spec = TaskSpec(
        name="pick_laptop",
        id=7,
        instructions=("pick up the laptop",),
        suites=("temporal", "spatial", "physical", "asymmetric", "asynchronous", "mixed"),
        props=(HOLDER, LAPTOP),
        varied=tuple(map(_varied, VARIED_HEIGHTS_M, VARIED_SIZES_M)),
        success=(Grasped("laptop"), Above("laptop", SUCCESS_HEIGHT_M)),
        horizon_ticks=300,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Holder on the table in any heading that both arms can serve, laptop on the holder."""
        holder_m, base_m = _sizes_m(scene)
        holder = AREA.sample(rng, TABLE_HEIGHT_M + holder_m[2] / 2)
        scene.place("holder", holder)
        spare_m = (holder_m - base_m)[:2] / 2
        offset_m = (*rng.uniform(-spare_m, spare_m), (holder_m[2] + base_m[2]) / 2)
        scene.place("laptop", holder @ Pose.upright(offset_m))
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Both hands near, then beside the laptop, push an edge of it between the other hand's fingers, lift."""
        way = max((_over_edge(scene, quarter) for quarter in range(4)), key=partial(_min_joint_margin, scene))
        (above, behind, pushed, away), (before, grasp, lifted) = way
        yield Stage("near", above, before, left_open=False, right_open=True, planned=True)
        yield Stage("beside", behind, grasp)
        yield Stage("push", left=pushed, right_open=False, right_holds="laptop")
        yield Stage("lift", away, lifted)


def _min_joint_margin(scene: SceneView, way: Way) -> float:
    """Least distance of any joint from its limits, as a share of its range; negative if a pose is out of reach."""
    return min(
        arm.margins(arm.ik(pose.matrix)).min(axis=1).max(initial=-1.0)
        for arm, poses in zip(scene.arm_pair.kinematics.values(), way, strict=True)
        for pose in poses
    )


def _sizes_m(scene: SceneView) -> NDArray[np.float64]:
    """(2, 3) full, of the holder and of the laptop's base."""
    return np.array([scene.prop(Riser, "holder").size_m, scene.prop(Laptop, "laptop").base_size_m])


def _over_edge(scene: SceneView, quarter: int) -> Way:
    """The way over the holder's near edge, turned by so many quarters."""
    holder, laptop = scene.pose("holder"), scene.pose("laptop")
    frame = laptop @ Pose.upright((0, 0, 0), quarter * np.pi / 2)  # the edge lies at its -y
    along, inward = frame.rotation[:, 0], frame.rotation[:, 1]
    sizes_m = _sizes_m(scene)
    holder_half_m, half_m = sizes_m[:, 1 - quarter % 2] / 2
    top_m = holder.position[2] + sizes_m[0, 2] / 2
    holder_y_m = frame.inverse().apply(holder.position)[1]
    shift_m = holder_half_m - half_m - holder_y_m + OVERHANG_M

    def left_hand(y_m: float) -> Pose:
        # Of the two rolls the one whose opening points to the right arm.
        x, y, _ = frame.apply((0, y_m, 0))
        position_m = (x, y, top_m + PUSH_ABOVE_HOLDER_M)
        return Pose.looking(position_m, (0, 0, -1), along if along[0] > 0 else -along)

    behind = left_hand(half_m + FINGER_HALF_M + BEHIND_M)
    pushed = left_hand(half_m + FINGER_HALF_M - shift_m)
    away = pushed.translated((*(AWAY_M[0] * inward[:2]), AWAY_M[1]))
    x, y, _ = frame.apply((0, INSIDE_EDGE_M - half_m - shift_m, 0))
    approach = np.cos(TILT_RAD) * inward - (0, 0, np.sin(TILT_RAD))
    above_m = VARIED_ABOVE_MIDDLE_M if scene.is_varied else GRASP_ABOVE_MIDDLE_M
    grasp = Pose.looking((x, y, top_m + sizes_m[1, 2] / 2 + above_m), approach, opening=(0, 0, -1))
    left = (behind.translated((0, 0, NEAR_M)), behind, pushed, away)
    return left, (grasp.advanced(-NEAR_M), grasp, grasp.translated((0, 0, LIFT_M)))
