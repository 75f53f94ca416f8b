"""Take the tray out of the oven.

According to the paper, one arm can do this task; the right arm alone can do everything in turn (docs/environment.md). Here the
right hand opens the door and moves aside. The left hand already waits where it then reaches in and takes the tray.

Departures from the original: every point of the tray must be above the oven's top while both fingers of one hand hold
it, as the paper's text has it; the original's code asks only that the tray has left its rack and is released. The
oven is turned by up to 32 degrees from 70 (45 from 53 in the original), about a point 48 cm before its middle. That point
lies anywhere in 30 x 28 cm, so that the oven's middle moves by 65 x 40 cm. The door weighs 0.8 kg instead of
0.1, its brake holds 0.15 N m instead of 1.0, and its hinge is damped by 3 N m s, so that it sinks open by itself when it
is let go of half-way: a horizontal hand cannot follow its handle all the way down. Its bar sits on rubber and gives by 12 mm,
so that a hand beside its arc is not pulled with 100 N. The rack's brake is 0.5 N instead of 0.1, and damped by 2 N s/m.
The bar and the tray's grip are short and protrude by 50 and 43 mm: with ones as wide as the original's, a motion that ignores
the scene would take the tray too often. Door and rack pass through the oven's body, so that they never jam.

In the setting `varied` six numbers determine the keyposes: the oven's place and heading, which of four heights its rack has,
and how far the tray on it is shifted to a side and turned. The bar is 4 cm long and 3 thick, the grip of the tray 4 cm wide
and 54 mm high, so that an open hand has a centimetre to spare.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Grasped, WhollyAbove
from lerobot_env_bimanual.props.baking_tray import BakingTray
from lerobot_env_bimanual.props.oven import Oven
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

OVEN = Oven("oven")
TRAY = BakingTray("tray")
AREA = PlacementArea(center_m=(0.32, 0.02), half_size_m=(0.15, 0.14), half_yaw_rad=np.deg2rad(32.0))
MEAN_YAW_RAD, BEHIND_M = np.deg2rad(70.0), 0.48
"""Area of a point before the oven, about which it is turned; its mean heading, and distance of its middle from that point."""
BESIDE_DOOR_M = (-0.65, -0.385)
"""The right base is before or beside this point of the oven's frame, or the door would swing down on its shoulder."""
TRAY_X_M = OVEN.front_m + 0.022 + TRAY.size_m[0] / 2
"""Of the tray's middle, in the oven's frame: 48 mm of it overhang the rack."""

VARIED_RACKS_M = (0.225, 0.255, 0.285, 0.315)
VARIED_OVEN = Oven("oven", handle_y_m=(-0.08, -0.04), handle_radius_m=0.015)
VARIED_TRAY = BakingTray("tray", handle_size_m=(0.043, 0.04), handle_height_m=0.054)
VARIED_ASIDE_M, VARIED_YAW_RAD = 0.05, np.deg2rad(10.0)

# The right hand: its fingers above and below the bar, pitched up with the door by a share of its angle, because
# below a hand that followed all the way there would be no room for it.
HANDLE_Y_M = -0.06
"""Where it grips the bar: to the right of the middle, within reach at every angle of the oven."""
BEFORE_HANDLE_M = 0.09
DOOR_RAD = np.deg2rad((17.0, 34.0, 50.0))
"""Angles of the door; at the last the hand lets go; the door sinks on by itself."""
PITCH_SHARE = 0.3
BACK_M, BACK_DOWN_RAD = 0.12, np.deg2rad(20.0)
ASIDE_M = (0.58, -0.40, 1.165)
"""Where it then waits, world frame: above the door's right, and out of the tray's way."""
ASIDE_UP_RAD = np.deg2rad(12.0)
"""Its pitch there. It points to the tray's grip, which its camera sees when the left hand hides it from the front."""

# The left hand: level, its fingers above and below the tray's handle.
WAIT_M = (-0.592, 0.15, 0.645)
"""In the oven's frame: outside the door's sweep."""
WAIT_DOWN_RAD = np.deg2rad(20.0)
"""Its pitch there: its camera sees the tray's grip as soon as the door is out of the way."""
BEFORE_TRAY_M = 0.10
INSERT_M = 0.023
"""Distance of the tool centre point behind the near end of the tray's grip; the fingertips reach 10 mm further, no rim between them."""
LIFT_M = 0.025
OUT_M = 0.28
RAISE_TO_M = 0.665
"""Above the table."""


@register
class TakeTrayOutOfOven(Task):
    """The right hand opens the door, the left hand takes the tray out and lifts it above the oven."""

    spec = TaskSpec(
        name="take_tray_out_of_oven",
        id=12,
        instructions=(
            "take tray out of oven",
            "open the oven and take the baking tray out",
            "grasp the handle on the over door, open it, and remove the tray from the oven",
            "get the baking tray from the oven",
            "get the tray",
            "take out the tray",
            "retrieve the oven tray",
        ),
        suites=("temporal", "asymmetric", "asynchronous", "prehensile"),
        props=(OVEN, TRAY),
        varied=tuple((replace(VARIED_OVEN, rack_m=rack_m), VARIED_TRAY) for rack_m in VARIED_RACKS_M),
        success=(Grasped("tray"), WhollyAbove("tray", TABLE_HEIGHT_M + OVEN.top_m)),
        horizon_ticks=520,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Oven closed in its corner, turned a little, tray on the rack."""
        oven = AREA.sample(rng, TABLE_HEIGHT_M) @ Pose.upright((0, 0, 0), MEAN_YAW_RAD)
        oven @= Pose.upright((BEHIND_M, 0, 0))
        tray = Pose.upright((TRAY_X_M, 0, scene.prop(Oven, "oven").rack_top_m + TRAY.size_m[2] / 2))
        if scene.is_varied:
            aside_m, yaw_rad = rng.uniform(-1, 1, 2) * (VARIED_ASIDE_M, VARIED_YAW_RAD)
            tray @= Pose.upright((0, aside_m, 0), yaw_rad)
        scene.place("oven", oven)
        scene.place("tray", oven @ tray)
        x, y, _ = oven.inverse().apply(scene.arm_pair.base_pose(Arm.RIGHT).position)
        return x < BESIDE_DOOR_M[0] or y < BESIDE_DOOR_M[1]

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Approach, grasp the handle, open, make way, grasp the tray, lift, take out, raise."""
        oven = scene.pose("oven")  # the door's way follows from its sizes: in a rehearsal it stays closed

        def handle(door_rad: float) -> Pose:
            return oven @ hand(OVEN.handle(door_rad, HANDLE_Y_M), PITCH_SHARE * door_rad)

        wait = oven @ hand(WAIT_M, -WAIT_DOWN_RAD, fingers_swapped=True)
        grasp = scene.pose("tray") @ hand((INSERT_M - TRAY.size_m[0] / 2, 0, 0), fingers_swapped=True)
        yield Stage("approach", wait, handle(0).advanced(-BEFORE_HANDLE_M), planned=True)
        yield Stage("grasp handle", right=handle(0), right_open=False)
        for rad in DOOR_RAD:
            yield Stage("open", right=handle(rad), right_open=rad == DOOR_RAD[-1], presses="oven_door")
        # Down with the sinking bar, or the fingers would be caught between that and the door's edge.
        back = hand((0, 0, 0), PITCH_SHARE * DOOR_RAD[-1] + BACK_DOWN_RAD).advanced(-BACK_M).position
        yield Stage("back", right=handle(DOOR_RAD[-1]).translated(oven.rotation @ back))
        x, y, _ = grasp.position - ASIDE_M
        aside = Pose.upright(ASIDE_M, math.atan2(y, x)) @ hand((0, 0, 0), ASIDE_UP_RAD)
        yield Stage("make way", grasp.advanced(-BEFORE_TRAY_M), aside)
        yield Stage("grasp tray", left=grasp, left_open=False, left_holds="tray")
        out = grasp.translated((0, 0, LIFT_M)).advanced(-OUT_M)
        yield Stage("lift", left=grasp.translated((0, 0, LIFT_M)))
        yield Stage("take out", left=out)
        yield Stage("raise", left=out.translated((0, 0, TABLE_HEIGHT_M + RAISE_TO_M - out.position[2])))


def hand(position, pitch_rad: float = 0.0, fingers_swapped: bool = False) -> Pose:
    """A hand that points into the oven and up by `pitch_rad`, its fingers one above the other; oven's frame."""
    sin, cos = np.sin(pitch_rad), np.cos(pitch_rad)
    opening = np.array([-sin, 0, cos])  # each arm takes the sign that keeps its wrist further from its limits
    return Pose.looking(position, approach=(cos, 0, sin), opening=-opening if fingers_swapped else opening)
