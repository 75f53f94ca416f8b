"""Straighten the rope.

The paper requires both ends in their areas. Both are held and pulled apart at the same time. The rope is springy: a
released end returns to its place in the curled rope, so both ends have to be held while success is judged.

Departures from the original: the rope springs back to the shape in which it was laid down; the original's lies still
where it is left, so one arm could put down one end after the other. The middle of each end must lie in the original's
area over its plate; in the original it is enough that any part of the end touches the area. The rope is 15 mm instead of 10 mm
thick and its ends are knots of 24 mm: fingers that come down a voxel too high close on nothing at a thin rope's
end. Ends and plates have matching colours, blue for the tail and red for the head; the original's plates are both
green.

In the setting `varied` seven numbers determine the keyposes: the plates' place, direction and distance, which fits a rope 35 to
41 cm long, and how the rope is shifted and turned from where it lies between them. One end may lie on its plate at the start,
and leaves it as the other one is pulled.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Inside
from lerobot_env_bimanual.props.rope import HEAD, TAIL, Rope
from lerobot_env_bimanual.props.target import Target
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.arena import TABLE_CENTRE_XY_M
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

ROPE = Rope("rope")
PLATE_SIZE_M = (0.10, 0.06)
TAIL_PLATE = Target("tail_plate", PLATE_SIZE_M, rgba=TAIL)
HEAD_PLATE = Target("head_plate", PLATE_SIZE_M, rgba=HEAD)
AREA = PlacementArea(center_m=(0.27, -0.07), half_size_m=(0.13, 0.19), half_yaw_rad=np.pi)
"""Area of the middle between the plates."""

# In the axes of the drawn pose: the plates lie on the y axis (decoded from RLBench's task file).
PLATE_OFFSET_M = 0.194
TAIL_START_M = np.array([0.0795, 0.182])
FROM_TAIL_TO_HEAD_RAD = -1.9509564435332885
"""Towards where the head starts, (-0.020, -0.067) m. A literal: the last bit of NumPy's arctangent depends on the processor."""
ON_PLATE_M = ((-0.05, -0.03, -0.002), (0.05, 0.03, 0.018))
"""The box in which an end counts, in the plate's frame (PerAct2 code)."""

VARIED_PITCHES_M = (0.0205, 0.0225, 0.024)
VARIED_OFFSET_M, VARIED_YAW_RAD = np.array([0.05, 0.04]), np.deg2rad(20.0)
"""How far the rope lies elsewhere, and is turned, from where it lies in `standard`."""

INSET_M = 0.015
"""Distance from the middle of a plate towards the other one: there the ends are 36 cm apart; the rope is 38 cm long."""
ABOVE_Z_M = 0.865
GRASP_Z_M = 0.765
"""Centre of a voxel; the fingertips, 1 cm beyond, end 5 mm above the table."""
MAX_SETTLE_TICKS = 40
# Straight down, fingers to both sides of the rope.
PREFERRED_OPENING = {Arm.LEFT: np.array([0.0, 1.0, 0.0]), Arm.RIGHT: np.array([-1.0, 0.0, 0.0])}


@register
class StraightenRope(Task):
    """Each hand grasps one end, and both drag theirs to its plate."""

    spec = TaskSpec(
        name="straighten_rope",
        id=8,
        instructions=(
            "straighten rope",
            "pull the rope straight",
            "grasping each end of the rope in turn, leave the rope straight on the table",
            "pull each end of the rope until is is straight",
            "tighten the rope",
            "pull the rope tight",
        ),
        suites=("temporal", "spatial", "physical", "asymmetric", "synchronous", "prehensile"),
        props=(TAIL_PLATE, HEAD_PLATE, ROPE),
        varied=tuple(
            (TAIL_PLATE, HEAD_PLATE, replace(ROPE, pitch_m=pitch_m)) for pitch_m in VARIED_PITCHES_M
        ),
        success=(
            Inside(ROPE.tail, "tail_plate", *ON_PLATE_M),
            Inside(ROPE.head, "head_plate", *ON_PLATE_M),
        ),
        horizon_ticks=300,
        plans=("each its own", "swapped"),
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Two plates in any direction, the rope in the shape of an S beside the line between them."""
        middle, rope = AREA.sample(rng, TABLE_HEIGHT_M), scene.prop(Rope, ROPE.name)
        scale = rope.pitch_m / ROPE.pitch_m
        scene.place("tail_plate", middle @ Pose.upright((0, scale * PLATE_OFFSET_M, 0)))
        scene.place("head_plate", middle @ Pose.upright((0, -scale * PLATE_OFFSET_M, 0)))
        if scene.is_varied:
            offset_m, yaw_rad = rng.uniform(-1, 1, 2) * VARIED_OFFSET_M, rng.uniform(-1, 1) * VARIED_YAW_RAD
            middle @= Pose.upright((*offset_m, 0), yaw_rad)
        heading_rad = FROM_TAIL_TO_HEAD_RAD + rope.tail_heading_rad
        laid = middle @ Pose.upright((*scale * TAIL_START_M, rope.knot_radius_m), heading_rad)
        at_rest_from_laid, joints = _at_rest(rope)
        scene.place(ROPE.name, laid @ at_rest_from_laid, joints)
        return True

    def script(self, scene: SceneView, variation: Variation, plan: int = 0) -> Iterator[Stage]:
        """Above, grasp, drag."""
        tail = scene.pose(ROPE.tail), scene.pose("tail_plate") @ Pose.upright((0, -INSET_M, 0))
        head = scene.pose(ROPE.head), scene.pose("head_plate") @ Pose.upright((0, INSET_M, 0))
        left_base, right_base = (pose.position for pose in scene.arm_pair.base_poses)
        # Each arm takes the end whose place and plate lie further on its own side; by plan 1, the other end.
        left, right = sorted(
            (tail, head),
            key=lambda end: (end[0].position + end[1].position) @ (right_base - left_base),
            reverse=plan == 1,
        )
        left_grasp, left_pull = _hands(*left, PREFERRED_OPENING[Arm.LEFT])
        right_grasp, right_pull = _hands(*right, PREFERRED_OPENING[Arm.RIGHT])
        up = np.array([0, 0, ABOVE_Z_M - GRASP_Z_M])
        above = left_grasp.translated(up), right_grasp.translated(up)
        yield Stage("above", *above, left_open=True, right_open=True, planned=True)
        yield Stage("grasp", left_grasp, right_grasp, left_open=False, right_open=False)
        yield Stage("pull", left_pull, right_pull)


def _hands(end: Pose, plate: Pose, preferred) -> tuple[Pose, Pose]:
    """Straight down on an end of the rope and on its plate, fingers to both sides of the rope."""
    across_end, across_plate = end.rotation[:, 1], plate.rotation[:, 0]
    if across_end @ across_plate < 0:
        across_plate = -across_plate
    side = 1 if (across_end + across_plate) @ preferred > 0 else -1

    def hand(at: Pose, across) -> Pose:
        return Pose.looking((*at.position[:2], GRASP_Z_M), approach=(0, 0, -1), opening=side * across)

    return hand(end, across_end), hand(plate, across_plate)


@cache
def _at_rest(rope: Rope) -> tuple[Pose, NDArray[np.float64]]:
    """Lay a rope down on an empty table, and wait until it sleeps; once per process instead of at every reset.

    Returns:
        Its root's pose at rest in the frame of where it was laid, and the values of its joints, in the model's order.
    """
    scene = Scene((rope,))
    laid = Pose.upright((*TABLE_CENTRE_XY_M, TABLE_HEIGHT_M + rope.knot_radius_m))
    scene.place(rope.name, laid)
    scene.settle(MAX_SETTLE_TICKS)
    hinges = 2 * (rope.links - 1)  # the scene's last joints
    return laid.inverse() @ scene.pose(rope.name), scene.data.qpos[-hinges:].copy()
