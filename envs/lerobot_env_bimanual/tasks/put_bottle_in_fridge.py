"""Put the bottle in the fridge.

The paper counts it among the tasks that one arm cannot do, for reachability. Here the door requires two arms: a spring
shuts it within half a second of its release, so the right hand holds it open while the left one puts the bottle in. A single
arm could drag the door ajar and slip in with the bottle in its hand. So at one tick the left hand must touch the bottle
inside while the right hand touches the door and the left arm does not.

Departures from the original: the bottle's foot must be in the upper compartment, below its shelf, with no arm
touching the bottle; the original asks for any part of the bottle in a lower volume and for two hands that hold
nothing, and its door stays open by itself. The door weighs 0.8 kg instead of 0.085 kg, is shut by 0.6 N m, and opens by 115
degrees instead of 90. Its handle is round and stands off by 50 mm, so that it can turn in a hand that turns less than the
door does. Nothing shows the bottle's yaw, so it has none. The fridge stands within 5 cm and 10 degrees of the original's place, so
that the right hand has to look, too.

In the setting `varied` seven numbers determine the keyposes: the bottle's place and the height of its pedestal, up to 8 cm, and
the fridge's place, heading and height (it reaches up to 8 cm into the table). The bottle is 6 cm wide and nearly fills the open
hand.
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Inside, Once, Touched, Untouched
from lerobot_env_bimanual.props.bottle import Bottle
from lerobot_env_bimanual.props.fridge import Fridge
from lerobot_env_bimanual.props.pedestal import Pedestal
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

FRIDGE = Fridge("fridge")
BOTTLE = Bottle("bottle")
IN_FRIDGE = Inside("bottle", "fridge", *FRIDGE.compartment)
DOOR_HELD = Touched("fridge_door", by=Arm.RIGHT), Untouched("fridge_door", by=Arm.LEFT)
FRIDGE_YAW_RAD = np.deg2rad(45.0)
FRIDGE_AREA = PlacementArea(center_m=(0.667, 0.292), half_size_m=(0.05, 0.05), half_yaw_rad=np.deg2rad(10.0))
"""The original's fridge is always at the middle of this area and heading."""
VARIED_BOTTLE, VARIED_STAND = replace(BOTTLE, radius_m=0.03), Pedestal("stand", (0.08, 0.08), depth_m=0.08)
VARIED_SUNK_M = 0.08
AREA_POSE = Pose.upright((0.05, -0.275, TABLE_HEIGHT_M), np.deg2rad(45.0))
AREA = PlacementArea(center_m=(0.0, 0.0), half_size_m=(0.225, 0.1125))

PITCH_RAD = np.deg2rad(10.0)
"""Pitch of both hands below the horizontal. The bottle stays upright as long as it does not change."""

# The left hand: its fingers to the sides of the bottle.
BRING_YAW_RAD = np.deg2rad(40.0)
"""Yaw of the left hand from grasp to release: nearly straight into the fridge, and feasible from everywhere."""
GRASP_M = 0.065
"""Above the bottle's foot; on the table the centre of a voxel."""
FOLD_M = (0.20, 0.10, 1.35)
"""Where the left hand goes first: the arms' ways from home to bottle and handle cross."""
ABOVE_BOTTLE_M = 0.15
LIFT_Z_M = 1.115
"""Above the world's floor, for every pedestal: below the right wrist, which passes by with the door."""
VIA_M = (0.22, -0.02, 1.20)
RELEASE_M = (0.062, 0.02)
"""Offset behind the plane of the opening and from its middle towards the handle's side, in the fridge's axes."""
RELEASE_Z_M = 0.465
"""Above the fridge's foot; the bottle drops 2 cm."""
BEFORE_FRIDGE_M = 0.17

# The right hand: its fingers to the sides of the upright bar, turning along by three quarters of the door's angle.
HANDLE_Z_M = 0.585
BEFORE_HANDLE_M = 0.09
PULL_YAW_RAD = np.deg2rad(50.0)
TURN_SHARE = 0.75
DOOR_RAD = np.deg2rad((20.0, 40.0, 60.0, 80.0))


@register
class PutBottleInFridge(Task):
    """The right hand opens the door and holds it, the left hand brings the bottle and puts it in."""

    spec = TaskSpec(
        name="put_bottle_in_fridge",
        id=5,
        instructions=(
            "put bottle in fridge",
            "place the bottle inside the fridge",
            "open the fridge and put the bottle in there",
            "open the fridge door, pick up the bottle, and leave it in the fridge",
        ),
        suites=("temporal", "asymmetric", "asynchronous", "prehensile"),
        props=(FRIDGE, BOTTLE),
        varied=((FRIDGE, VARIED_BOTTLE, VARIED_STAND),),
        success=(
            IN_FRIDGE,
            *(Untouched("bottle", by=arm) for arm in ARMS),
            Once((IN_FRIDGE, Touched("bottle", by=Arm.LEFT), *DOOR_HELD)),
        ),
        horizon_ticks=420,
        needs_both_arms=True,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Fridge closed in its corner, bottle in the oblong area before it."""
        sunk_m, stand_m = (
            rng.uniform(0, (VARIED_SUNK_M, VARIED_STAND.depth_m)) if scene.is_varied else (0.0, 0.0)
        )
        fridge = FRIDGE_AREA.sample(rng, TABLE_HEIGHT_M - sunk_m)
        scene.place("fridge", fridge @ Pose.upright((0, 0, 0), FRIDGE_YAW_RAD))
        bottle = Pose.upright((AREA_POSE @ AREA.sample(rng, stand_m)).position)
        scene.place("bottle", bottle)
        if scene.is_varied:
            scene.place("stand", bottle)
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Fold, approach, grasp both, open the door and hold it, bring the bottle, insert, withdraw."""
        fridge, bottle = scene.pose("fridge"), scene.pose("bottle").position
        turned_rad = math.atan2(fridge.rotation[1, 0], fridge.rotation[0, 0]) - FRIDGE_YAW_RAD
        bring_yaw_rad, pull_yaw_rad = BRING_YAW_RAD + turned_rad, PULL_YAW_RAD + turned_rad
        grasp = hand(np.add(bottle, (0, 0, GRASP_M)), bring_yaw_rad)
        depth, aside = RELEASE_M
        release = hand(fridge.apply((FRIDGE.front_m + depth, aside, RELEASE_Z_M)), bring_yaw_rad)
        before_fridge = release.translated(-BEFORE_FRIDGE_M * heading(bring_yaw_rad))

        def pull(door_rad: float) -> Pose:
            handle = fridge.apply(FRIDGE.handle(door_rad, HANDLE_Z_M))
            return hand(handle, pull_yaw_rad + TURN_SHARE * door_rad)

        yield Stage("fold", left=hand(FOLD_M, bring_yaw_rad), planned=True)
        above = grasp.translated((0, 0, ABOVE_BOTTLE_M))
        yield Stage("approach", above, pull(0).advanced(-BEFORE_HANDLE_M), planned=True)
        yield Stage("grasp", grasp, pull(0), left_open=False, right_open=False, left_holds="bottle")
        lift, via = (hand(place, bring_yaw_rad) for place in ((*bottle[:2], LIFT_Z_M), VIA_M))
        for left, door_rad in zip((lift, None, None, via), DOOR_RAD, strict=True):
            yield Stage("open", left, pull(door_rad), turns=("fridge_hinge", door_rad))
        yield Stage("bring", left=before_fridge)
        yield Stage("insert", left=release, left_open=True)
        yield Stage("withdraw", left=before_fridge)


def heading(yaw_rad: float) -> np.ndarray:
    """(3,) horizontal unit vector."""
    return np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])


def hand(position: ArrayLike, yaw_rad: float) -> Pose:
    """A hand that points `PITCH_RAD` down in the direction of `yaw_rad`, its fingers side by side."""
    approach = np.cos(PITCH_RAD) * heading(yaw_rad) - (0, 0, np.sin(PITCH_RAD))
    return Pose.looking(position, approach, opening=heading(yaw_rad + np.pi / 2))
