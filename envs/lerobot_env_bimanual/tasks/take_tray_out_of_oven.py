"""Take the tray out of the oven.

Bimanual because of its order: the right hand opens the door and makes way before the left hand reaches in and
takes the tray.

Departures from the original: TODO
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Grasped, WhollyAbove
from lerobot_env_bimanual.placement import PlacementArea
from lerobot_env_bimanual.props.baking_tray import BakingTray
from lerobot_env_bimanual.props.oven import Oven
from lerobot_env_bimanual.registry import register
from lerobot_env_bimanual.task import Prehension, Stage, Task, TaskSpec, Taxonomy, Variation

if TYPE_CHECKING:
    from lerobot_env_bimanual.scene import Scene

OVEN = Oven("oven")
TRAY = BakingTray("tray")
AREA = PlacementArea(center_m=(0.50, 0.335), half_size_m=(0.085, 0.085), half_yaw_rad=np.deg2rad(20.0))
MEAN_YAW_RAD = np.deg2rad(65.0)
TRAY_EDGE_M = OVEN.front_m + 0.022
"""Where the tray's handle begins, in the oven's frame: 48 mm of it overhang the rack."""
TRAY_M = (TRAY_EDGE_M + TRAY.size_m[0] / 2, 0.0, OVEN.rack_top_m + TRAY.size_m[2] / 2)

# The right hand: its fingers above and below the bar, pitched up with the door by a share of its angle, because
# below a hand that followed all the way there would be no room for it.
HANDLE_Y_M = -0.08
BEFORE_HANDLE_M = 0.09
DOOR_RAD = np.deg2rad((17.0, 34.0, 50.0))
"""At the last of which the hand lets go; the door sinks on by itself."""
PITCH_SHARE = 0.3
BACK_M = 0.15
ASIDE_M = (0.58, -0.40, 1.165)
"""Where it then waits, world frame: beside the door, and below the left arm's way with the tray."""

# The left hand: level, its fingers above and below the tray's handle.
WAIT_M = (-0.40, 0.15, 0.685)
"""Before the front, to the left, above the table: outside the door's sweep."""
TRAY_Y_M = 0.0
BEFORE_TRAY_M = 0.10
INSERT_M = 0.028
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
        variations=(Variation(),),
        taxonomy=Taxonomy(
            temporal=True,
            spatial=False,
            physical=False,
            symmetric=False,
            synchronous=False,
            prehension=Prehension.PREHENSILE,
        ),
        props=(OVEN, TRAY),
        success=(Grasped("tray"), WhollyAbove("tray", TABLE_HEIGHT_M + OVEN.top_m)),
        horizon_ticks=600,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Oven closed in its corner, turned a little, tray on the rack."""
        oven = AREA.sample(rng, TABLE_HEIGHT_M)
        oven = oven @ Pose.upright((0, 0, 0), MEAN_YAW_RAD)
        scene.place("oven", oven)
        scene.place("tray", oven @ Pose.upright(TRAY_M))
        return True

    def script(self, scene: Scene, variation: Variation) -> Iterator[Stage]:
        """Approach, grasp the handle, open, make way, grasp the tray, lift, take out, raise."""
        oven = scene.pose("oven")

        def handle(door_rad: float) -> Pose:
            pitch_rad = PITCH_SHARE * door_rad
            return oven @ _hand(OVEN.handle(door_rad, HANDLE_Y_M), pitch_rad, opening=RSIGN)

        wait = oven @ _hand((OVEN.front_m + WAIT_M[0], TRAY_Y_M + WAIT_M[1], WAIT_M[2]), opening=LSIGN)
        grasp = oven @ _hand((TRAY_EDGE_M + INSERT_M, TRAY_Y_M, TRAY_M[2]), opening=LSIGN)
        yield Stage("approach", wait, handle(0).advanced(-BEFORE_HANDLE_M), planned=True)
        yield Stage("grasp handle", right=handle(0), right_open=False)
        for door_rad in DOOR_RAD[:-1]:
            yield Stage("open", right=handle(door_rad))
        yield Stage("open", right=handle(DOOR_RAD[-1]), right_open=True)
        back = handle(DOOR_RAD[-1]).advanced(-BACK_M)
        yield Stage("back", right=back)
        aside = Pose(np.array(ASIDE_M), back.quat_wxyz)
        yield Stage("make way", grasp.advanced(-BEFORE_TRAY_M), aside)
        yield Stage("grasp tray", left=grasp, left_open=False, left_holds="tray")
        lifted = grasp.translated((0, 0, LIFT_M))
        yield Stage("lift", left=lifted)
        out = lifted.advanced(-OUT_M)
        yield Stage("take out", left=out)
        yield Stage("raise", left=out.translated((0, 0, TABLE_HEIGHT_M + RAISE_TO_M - out.position[2])))

RSIGN, LSIGN = 1, -1

def _hand(position, pitch_rad: float = 0.0, opening: int = 1) -> Pose:
    """A hand that points into the oven and up by `pitch_rad`, its fingers one above the other; oven's frame."""
    sin, cos = np.sin(pitch_rad), np.cos(pitch_rad)
    return Pose.looking(position, approach=(cos, 0, sin), opening=np.multiply(opening, (-sin, 0, cos)))
