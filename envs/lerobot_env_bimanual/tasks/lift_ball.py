"""Lift the ball.

The paper counts it among the tasks that one arm cannot do. The ball, 30 cm wide, fits no gripper: two hands press it from
both sides and have to stay opposite each other, at the same height, all the way up; and both have to touch it in the end.

Departures from the original: the ball must be held between both hands while its centre is at 0.95 m or higher,
where the original asks for the height alone. The hands are closed and pinch at the equator instead of scooping
with open fingers, friction is 0.3 instead of 0.5 and placements spread over 34 x 34 cm, for otherwise a motion that
ignores the scene lifts the ball almost anywhere. There is no yaw, since nothing on a sphere shows it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Touched
from lerobot_env_bimanual.props.ball import Ball
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Taxonomy, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

BALL = Ball("ball", radius_m=0.15, mass_kg=1.0, friction=0.3)
AREA = PlacementArea(center_m=(0.25, -0.05), half_size_m=(0.17, 0.17))
SUCCESS_HEIGHT_M = 0.95

APPROACH_GAP_M = 0.06
"""Distance from the ball to the tool centre points; so close that a ball lying elsewhere is already in the way."""
SQUEEZE_DEPTH_M = 0.010
"""The wrists then carry 8 of their 12 N m at most; deeper commands let the ball drift towards the weaker arm."""
LIFT_TO_M = 1.10


@register
class LiftBall(Task):
    """Two closed hands pinch the ball at its equator and go up."""

    spec = TaskSpec(
        name="lift_ball",
        id=1,
        instructions=("lift the ball",),
        taxonomy=Taxonomy.of("temporal spatial physical symmetric synchronous non_prehensile"),
        props=(BALL,),
        success=(
            Above("ball", SUCCESS_HEIGHT_M),
            Touched("ball", by=Arm.LEFT),
            Touched("ball", by=Arm.RIGHT),
        ),
        horizon_ticks=200,
        needs_both_arms=True,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Ball anywhere between the arms."""
        scene.place("ball", AREA.sample(rng, TABLE_HEIGHT_M + BALL.radius_m))
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Go beside the ball, squeeze it, lift it."""
        ball = scene.pose("ball").position
        apart, pressed = BALL.radius_m + APPROACH_GAP_M, BALL.radius_m - SQUEEZE_DEPTH_M
        lifted = np.array([*ball[:2], LIFT_TO_M])
        yield Stage("beside", *_hands(ball, apart), left_open=False, right_open=False, planned=True)
        yield Stage("squeeze", *_hands(ball, pressed), presses="ball")
        yield Stage("lift", *_hands(lifted, pressed), presses="ball")


def _hands(center: np.ndarray, distance_m: float) -> tuple[Pose, Pose]:
    """Left and right hand facing each other along y, fingers one above the other, around `center`."""
    offset = np.array([0.0, distance_m, 0.0])
    left = Pose.looking(center + offset, approach=(0, -1, 0), opening=(0, 0, 1))
    right = Pose.looking(center - offset, approach=(0, 1, 0), opening=(0, 0, 1))
    return left, right
