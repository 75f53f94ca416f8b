"""Lift the ball.

The paper counts it among the tasks that one arm cannot do. The ball, 30 cm wide, fits no gripper: two hands press it from
both sides and have to stay opposite each other, at the same height, all the way up; and both have to touch it in the end.
In one scene the right hand alone carried the ball, as on a fork, against the left one (docs/environment.md).

Departures from the original: the ball must be held between both hands while its centre is at 0.95 m or higher,
where the original asks for the height alone. The hands are closed and pinch at the equator instead of scooping
with open fingers. Friction is 0.08 instead of 0.5, so that only a pinch from 3 cm below to 1 cm above the middle lifts the
ball, which therefore weighs 0.25 kg instead of 1.0 kg; from 2 cm below on, a deep pinch alone pushes it up onto the hands.
Placements spread over 40 x 40 cm. There is no yaw, since nothing on a sphere shows it.

In the setting `varied` five numbers determine the keyposes: the ball, 20 to 29 cm wide, lies on a pedestal of any height up to
4 cm, and the fingers reach it only between two posts on either side, which leave 1 cm to spare and turn with the pedestal.
The height matters little: hands sent to 0.87 m solve 30 of 30 scenes.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Touched
from lerobot_env_bimanual.props.ball import Ball
from lerobot_env_bimanual.props.pedestal import Pedestal
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

BALL = Ball("ball", radius_m=0.15, mass_kg=0.25, friction=0.08)
AREA = PlacementArea(center_m=(0.25, -0.05), half_size_m=(0.20, 0.20))
SUCCESS_HEIGHT_M = 0.95

VARIED_RADII_M = (0.100, 0.115, 0.130, 0.145)
VARIED_HEIGHT_M = 0.04
VARIED_YAW_RAD = np.deg2rad((-10.0, 30.0))
"""Range within the reach of both arms; a ball can be lifted along any axis."""
GATE_HALF_M = 0.026
"""Half the distance of the posts' middles: the fingers, 2 cm wide, pass with 1 cm to spare on either side."""
GATE_GAP_M = 0.02
"""From the ball to the posts' middles."""


def _stand(radius_m: float) -> Pedestal:
    y_m = radius_m + GATE_GAP_M
    posts = [(x, y, radius_m) for x in (-GATE_HALF_M, GATE_HALF_M) for y in (-y_m, y_m)]
    return Pedestal("stand", (0.07, 0.07), VARIED_HEIGHT_M, posts_m=tuple(posts))


APPROACH_GAP_M, VARIED_GAP_M = 0.030, 0.06
"""Distance from the ball to the tool centre points: in `standard` so close that a ball lying elsewhere is already in the way."""
SQUEEZE_SHARE = 1 / 18
"""Depth of the squeeze, as a share of the radius. The wrists then carry 8 of their 12 N m at most; deeper commands let the ball
drift towards the weaker arm."""
LIFT_TO_M = 1.10
TURNED_RAD = np.deg2rad(25.0)
"""Turn of the axis along which the hands press, in the second plan."""


@register
class LiftBall(Task):
    """Two closed hands pinch the ball at its equator and go up."""

    spec = TaskSpec(
        name="lift_ball",
        id=1,
        instructions=("lift the ball",),
        suites=("temporal", "spatial", "physical", "symmetric", "synchronous", "non_prehensile"),
        props=(BALL,),
        varied=tuple((replace(BALL, radius_m=each), _stand(each)) for each in VARIED_RADII_M),
        success=(
            Above("ball", SUCCESS_HEIGHT_M),
            Touched("ball", by=Arm.LEFT),
            Touched("ball", by=Arm.RIGHT),
        ),
        horizon_ticks=200,
        needs_both_arms=True,
        plans=("along y", "turned"),
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Ball anywhere between the arms."""
        place, radius_m = AREA.sample(rng, TABLE_HEIGHT_M), scene.prop(Ball, "ball").radius_m
        if scene.is_varied:
            height_m, yaw_rad = rng.uniform(0, VARIED_HEIGHT_M), rng.uniform(*VARIED_YAW_RAD)
            place = place.translated((0, 0, height_m)) @ Pose.upright((0, 0, 0), yaw_rad)
            scene.place("stand", place)
        scene.place("ball", place.translated((0, 0, radius_m)))
        return True

    def script(self, scene: SceneView, variation: Variation, plan: int = 0) -> Iterator[Stage]:
        """Go beside the ball, squeeze it, lift it."""
        ball, radius_m = scene.pose("ball"), scene.prop(Ball, "ball").radius_m
        if plan:
            ball @= Pose.upright((0, 0, 0), TURNED_RAD)
        gap_m = VARIED_GAP_M if scene.is_varied else APPROACH_GAP_M
        apart, pressed = radius_m + gap_m, radius_m * (1 - SQUEEZE_SHARE)
        lifted = ball.translated((0, 0, LIFT_TO_M - ball.position[2]))
        yield Stage("beside", *_hands(ball, apart), left_open=False, right_open=False, planned=True)
        yield Stage("squeeze", *_hands(ball, pressed), presses="ball")
        yield Stage("lift", *_hands(lifted, pressed), presses="ball")


def _hands(ball: Pose, distance_m: float) -> tuple[Pose, Pose]:
    """Left and right hand facing each other along the ball's y axis, fingers one above the other."""
    along = ball.rotation[:, 1]
    left = Pose.looking(ball.position + distance_m * along, approach=-along, opening=(0, 0, 1))
    right = Pose.looking(ball.position - distance_m * along, approach=along, opening=(0, 0, 1))
    return left, right
