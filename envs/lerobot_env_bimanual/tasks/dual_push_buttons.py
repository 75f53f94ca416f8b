"""Push the two named buttons.

The paper counts it among the tasks that one arm cannot do, since both buttons have to be down at the same time. Buttons
are at least 38 cm apart; one hand, laid flat from fingertips to wrist, can press two buttons up to 36 cm apart. Hand and forearm
can press some that are up to 42 cm apart, in postures found by search (docs/environment.md).

Without the instruction, the two buttons cannot be known: the same three colours occur with different answers in any
layout (guessing is right in 40 %).

Departures from the original: both caps must be down together, as the paper's text says, for half a second; the
original is satisfied when the first and some time later the second has been touched. The five variations are triples of
our own choice; of the original's first five, three share their distractor, which is never to be pressed. Buttons keep 38 cm
apart, where the original's may overlap. The original draws one button in either half of the table, the first colour's in
the right half, which gives the answer away; here the right hand presses the one nearer to its side, whichever is named
first. Pressing the third button, too, does no harm. The caps are pressed by 10 of their 14 mm, so that no hand strikes a
base.

In the setting `varied` each button is on a box of its own height, up to 8 cm: six numbers determine the keyposes. Caps are
24 mm wide.
"""

from collections.abc import Iterator
from functools import partial
from itertools import combinations

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Pressed
from lerobot_env_bimanual.props.button import Button
from lerobot_env_bimanual.props.pedestal import Pedestal
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Script, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

COLORS = {
    "yellow": (1.0, 1.0, 0.0, 1.0),
    "azure": (0.0, 0.5, 1.0, 1.0),
    "green": (0.0, 0.5, 0.0, 1.0),
    "purple": (0.5, 0.0, 0.5, 1.0),
    "orange": (1.0, 0.5, 0.0, 1.0),
}
"""Five of the original's eighteen, with its values."""
TRIPLES = (
    ("green", "yellow", "azure"),
    ("azure", "green", "yellow"),
    ("green", "purple", "orange"),
    ("orange", "green", "purple"),
    ("purple", "orange", "green"),
)
"""Every colour is named in one variation and not named in another with the same colours."""
WORDS = ("color_a", "color_b", "color_other")
"""The two to press, and the one to leave alone; triples are in this order."""

BUTTONS = RIGHT, LEFT, OTHER = "right_button", "left_button", "other_button"
AREA = PlacementArea((0.25, 0.0125), half_size_m=(0.258, 0.4159), half_yaw_rad=np.pi)
"""Both halves of the original."""
MIN_DISTANCE_M = 0.38
MAX_DRAWS = 1000
REACH_M = {Arm.LEFT: (0.31, 0.83), Arm.RIGHT: (0.30, 0.76)}
"""Least and largest distance from an arm's base to a button that it may have to press."""

HOVER_M, PRESS_M = 0.115, 0.035
"""Heights above a button's foot; on the table, centres of voxels. At `PRESS_M` the fingertips are 4 mm above the base."""

VARIED_CAP_RADIUS_M = 0.012  # instead of 0.028
STANDS = tuple(Pedestal(f"{button}_stand", (0.10, 0.10), depth_m=0.08) for button in BUTTONS)


@register
class DualPushButtons(Task):
    """Two closed hands come down on the two buttons together."""

    spec = TaskSpec(
        name="dual_push_buttons",
        id=2,
        instructions=(
            "push the {color_a} and the {color_b} buttons",
            "press the {color_a} and the {color_b} buttons",
            "push down the buttons with the {color_a} and the the {color_b} base",  # spelled like the original
        ),
        variations=tuple(
            Variation(index, dict(zip(WORDS, colors, strict=True))) for index, colors in enumerate(TRIPLES)
        ),
        suites=("temporal", "symmetric", "asynchronous", "non_prehensile"),
        props=tuple(Button(name) for name in BUTTONS),
        varied=((*(Button(name, VARIED_CAP_RADIUS_M) for name in BUTTONS), *STANDS),),
        success=(Pressed(RIGHT), Pressed(LEFT)),
        horizon_ticks=160,
        needs_both_arms=True,
        plans=("each its own", "swapped"),
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Place three buttons so that the two hands can press any two; the one to leave alone is drawn afterwards."""
        poses = _draw_apart({arm: scene.arm_pair.base_pose(arm) for arm in ARMS}, rng)
        if poses is None:
            return False
        other = poses.pop(rng.integers(len(poses)))
        *target_colours, left_alone = (COLORS[variation.words[word]] for word in WORDS)
        rng.shuffle(target_colours)
        for name, pose, rgba in zip(BUTTONS, (*poses, other), (*target_colours, left_alone), strict=True):
            if scene.is_varied:
                pose = pose.translated((0, 0, rng.uniform(0, STANDS[0].depth_m)))
                scene.place(f"{name}_stand", pose)
            scene.place(name, pose)
            scene.set_color(name, rgba)
        return True

    def script(self, scene: SceneView, variation: Variation, plan: int = 0) -> Iterator[Stage]:
        """Above, press."""
        return press(scene, *((RIGHT, LEFT) if plan else (LEFT, RIGHT)))

    def script_for_instruction(self, scene: SceneView, variation: Variation) -> Script | None:
        """Push the buttons of the two named colours, if both are there, each with the hand on whose side it lies."""
        named = [COLORS[variation.words[word]] for word in WORDS[:2]]
        found = [button for button in BUTTONS if any(scene.has_color(button, color) for color in named)]
        if len(found) < len(named):
            return None
        right, left = sorted(found, key=lambda button: scene.pose(button).position[1])
        return partial(press, left_button=left, right_button=right)


def press(scene: SceneView, left_button: str, right_button: str) -> Iterator[Stage]:
    """Either hand above its button, then both down, narrow side along y, so that hands over neighbours do not meet."""
    left, right = (
        Pose.looking(scene.pose(button).position, approach=(0, 0, -1), opening=(side, 0, 0))
        for button, side in ((left_button, 1), (right_button, -1))
    )
    above = left.advanced(-HOVER_M), right.advanced(-HOVER_M)
    yield Stage("above", *above, left_open=False, right_open=False, planned=True)
    yield Stage("press", left.advanced(-PRESS_M), right.advanced(-PRESS_M))


def _draw_apart(bases: dict[Arm, Pose], rng: np.random.Generator) -> list[Pose] | None:
    """Three poses in order of y, uniform over those apart and in reach (the middle one of both arms); None if none is found."""
    for _ in range(MAX_DRAWS):
        drawn = (AREA.sample(rng, TABLE_HEIGHT_M) for _ in BUTTONS)
        poses = sorted(drawn, key=lambda pose: pose.position[1])
        in_reach = all(
            least <= pose.distance_to(bases[arm])[0] <= largest
            for arm, shared in ((Arm.RIGHT, poses[:2]), (Arm.LEFT, poses[1:]))
            for least, largest in [REACH_M[arm]]
            for pose in shared
        )
        if in_reach and all(a.distance_to(b)[0] >= MIN_DISTANCE_M for a, b in combinations(poses, 2)):
            return poses
    return None
