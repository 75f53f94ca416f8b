"""Pick up the plate.

The paper asks that the plate be securely grasped and lifted, and calls it difficult, not impossible, for one arm. The left
hand presses on one side of the rim, until the other side rises high enough for the right hand to pinch it. A single hand that
pushes the plate over the table's edge can pinch it there, so the plate may not be moved by more than 10 cm before it is lifted;
the expert moves it by 1 cm at most. A steep, half-open hand can jam a finger under the rim of a plate that lies flat, so each
hand has to touch the plate while it is tipped and still low.

Departures from the original: the plate must be between the fingers of one hand while it is at 1.00 m or higher;
the original, whose text asks for a secure grasp, checks the height alone. The plate weighs 120 g instead of half
a gram and is slippery, with a friction of 0.35 instead of 1.0 against everything. Its rim is 1.5 cm wide and ends 1.2 cm high
instead of 1.8 cm, so that only a press within a centimetre of the right place tips it. It lies in a box of 28 x 43 cm. The right
hand approaches at 58 degrees below the horizontal, nearly in the plane of the raised rim, and the left one leans back by 30
degrees, since the plate strikes an upright one when it swings.

In the setting `varied` five numbers determine the keyposes: the plate, 15 to 17 cm wide and with a rim of 2.2 cm, lies on a
pedestal of any height up to 8 cm, and the fingers reach its rim only between two walls, which leave 1 cm to spare and turn with
the pedestal by 30 degrees.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Always, Grasped, Near, Once, Raised, Tipped, Touched
from lerobot_env_bimanual.props.pedestal import Pedestal
from lerobot_env_bimanual.props.plate import Plate
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

PLATE = Plate("plate", radius_m=0.075, height_m=0.012, mass_kg=0.12)
AREA = PlacementArea(center_m=(0.20, -0.155), half_size_m=(0.14, 0.215))
SUCCESS_HEIGHT_M = 1.00
MAX_SHIFT_M, LIFTED_M, TIPPED_DEG = 0.10, 0.06, 15.0
"""Largest shift of the plate before it is lifted, rise at which it counts as lifted, and least lean under each hand before."""

VARIED_AREA = PlacementArea(center_m=(0.21, -0.17), half_size_m=(0.075, 0.16))
VARIED_RADII_M = (0.074, 0.078, 0.082, 0.086)
VARIED_HEIGHT_M = 0.08
VARIED_YAW_RAD = np.deg2rad(15.0)
SLOT_HALF_M, WALL_M = 0.018, (0.010, 0.05, 0.066)
"""Distance of the walls, to either side, from where the rim is pinched, and their thickness, width and height. They are
6 mm from the rim's edge."""

# Positions are in the plate's axes while it lies flat.
ASIDE_RAD = np.deg2rad(-25.0)
"""Angle from the direction of the right arm to the plate's x axis; the arm cannot lift a pitched hand straight before itself."""
OTHER_RAD = np.deg2rad(112.0)
"""Angle from that x axis to the one of the second plan, in which the arms change places."""

# The left hand: closed, leaning back, on the far side of the rim.
LEAN_RAD = np.deg2rad(30.0)
INSIDE_RIM_M, PRESS_Z_M = 0.008, 0.015
"""Where it presses. The fingertips, 1 cm beyond, end 6 mm above the table, where the rim comes down."""
ABOVE_M = np.array([0.0, 0.0, 0.08])
LEAVE_M = np.array([-0.05, 0.0, 0.04])
"""Back and only a little up: a plate that swings while it is raised must not strike the fingers."""

# The right hand: from +x, its fingers opening in the vertical plane.
PITCH_RAD = np.deg2rad(58.0)
WAIT_M = np.array([0.20, 0.0, 0.22])
WAIT_LOWER_M = np.array([0.16, 0.0, 0.17])
BELOW_RIM_M = np.array([0.008, 0.0, 0.0015])
"""Where the rim is pinched: inside its edge and below it, in the plate's axes."""
BEFORE_RIM_M = 0.07
SHORT_OF_RIM_M = 0.003
LIFT_M = np.array([0.02, 0.0, 0.12])
RAISE_TO_M = 1.125


def _varied(radius_m: float) -> tuple[Prop, ...]:
    x, (thick, wide, high) = radius_m + WALL_M[0] / 2 + 0.006, WALL_M
    walls = tuple((x, side * (SLOT_HALF_M + wide / 2), thick, wide, high) for side in (-1, 1))
    stand = Pedestal("stand", (0.20, 0.20), VARIED_HEIGHT_M, walls_m=walls)
    return replace(PLATE, radius_m=radius_m, height_m=0.0155, rim_m=0.022), stand


@register
class PickPlate(Task):
    """The left hand tips the plate up, the right hand pinches the raised rim and lifts."""

    spec = TaskSpec(
        name="pick_plate",
        id=3,
        instructions=("pick up the plate",),
        suites=("temporal", "spatial", "physical", "asymmetric", "asynchronous", "mixed"),
        props=(PLATE,),
        varied=tuple(map(_varied, VARIED_RADII_M)),
        success=(
            Grasped("plate"),
            Above("plate", SUCCESS_HEIGHT_M),
            Always((Near("plate", MAX_SHIFT_M), Raised("plate", LIFTED_M))),
            *(Once((Touched("plate", by=arm), Tipped("plate", TIPPED_DEG, LIFTED_M))) for arm in ARMS),
        ),
        horizon_ticks=320,
        plans=("left presses", "right presses"),
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Plate flat on the table; nothing shows its yaw, so its x axis can define the direction in which the task is done."""
        plate = (VARIED_AREA if scene.is_varied else AREA).sample(rng, TABLE_HEIGHT_M)
        x, y, _ = scene.arm_pair.base_pose(Arm.RIGHT).position - plate.position
        plate = Pose.upright(plate.position, math.atan2(y, x) + ASIDE_RAD)
        if scene.is_varied:
            plate = plate.translated((0, 0, rng.uniform(0, VARIED_HEIGHT_M)))
            plate @= Pose.upright((0, 0, 0), rng.uniform(-1, 1) * VARIED_YAW_RAD)
            scene.place("stand", plate)
        scene.place("plate", plate)
        return True

    def script(self, scene: SceneView, variation: Variation, plan: int = 0) -> Iterator[Stage]:
        """Above, press, reach for the raised rim where it really is, grasp, lift, raise."""
        other = Pose.upright((0, 0, 0), OTHER_RAD)
        if not plan:
            return _stages(scene, lambda: scene.pose("plate"))
        return (stage.swapped() for stage in _stages(scene, lambda: scene.pose("plate") @ other))


def _stages(scene: SceneView, pose_now: Callable[[], Pose]) -> Iterator[Stage]:
    """Stages in which the left hand presses and the right one pinches; `pose_now`'s x axis points to the pinched side."""
    flat, plate = pose_now(), scene.prop(Plate, "plate")
    ahead, aside, up = flat.rotation.T
    press_m = flat.apply((INSIDE_RIM_M - plate.radius_m, 0.0, PRESS_Z_M))
    press = Pose.looking(press_m, np.sin(LEAN_RAD) * ahead - np.cos(LEAN_RAD) * up, aside)
    right = Pose.looking(flat.position, -np.cos(PITCH_RAD) * ahead - np.sin(PITCH_RAD) * up, -up)

    def along(pose: Pose, offset_m: np.ndarray) -> Pose:
        return pose.translated(flat.rotation @ offset_m)

    wait = along(right, WAIT_M)
    yield Stage("above", along(press, ABOVE_M), wait, left_open=False, right_open=True, planned=True)
    yield Stage("press", press, along(right, WAIT_LOWER_M))
    rim_m = np.array([plate.radius_m, 0.0, plate.height_m]) - BELOW_RIM_M
    rim = Pose(_pressed(plate, pose_now()).apply(rim_m), right.quat_wxyz)
    grasp = rim.advanced(-SHORT_OF_RIM_M)
    yield Stage("reach", right=rim.advanced(-BEFORE_RIM_M))
    yield Stage("grasp", right=grasp, right_open=False, right_holds="plate")
    lifted = along(grasp, LIFT_M)
    yield Stage("lift", along(press, LEAVE_M), lifted)
    yield Stage("raise", right=lifted.translated((0, 0, RAISE_TO_M - lifted.position[2])))


def _pressed(plate: Plate, pose: Pose) -> Pose:
    """The plate's pose; while the plate is still flat, its pose once it is pressed: tipped over the foot's edge.

    In a rehearsal, which has no physics, the plate stays flat.
    """
    if pose.rotation[2, 2] < np.cos(plate.tip_rad / 2):
        return pose
    edge = np.array([-plate.foot_radius_m, 0.0, 0.0])
    tip = Pose(np.zeros(3), quat_wxyz_from_axis_angle((0, 1, 0), -plate.tip_rad))
    return pose @ tip.translated(edge - tip.apply(edge))
