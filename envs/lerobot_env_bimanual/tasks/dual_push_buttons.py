"""Push the two named buttons.

The paper counts it among the tasks that one arm cannot do, since both buttons have to be down at the same time. They
are at least 15 cm apart and mostly much further; a palm that lies flat on them spans 24 cm, a hand with its wrist 31 cm,
and there one arm succeeds (docs/tasks.md).

Departures from the original: both caps must be down together, as the paper's text says, for half a second; the
original is satisfied when the first and some time later the second has been touched. There are the paper's five
variations, which are the first five of the original's fifty triples of colours. Buttons keep 15 cm apart, where
the original's may overlap. Pressing the third button in addition does no harm. The hands come to
rest 6 mm above where they are sent, on the buttons' bases.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Pressed
from lerobot_env_bimanual.placement import PlacementArea
from lerobot_env_bimanual.props.button import Button
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Prehension, Task, TaskSpec, Taxonomy, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

COLORS = {
    "olive": (0.5, 0.5, 0.0, 1.0),
    "orange": (1.0, 0.5, 0.0, 1.0),
    "azure": (0.0, 0.5, 1.0, 1.0),
    "gray": (0.5, 0.5, 0.5, 1.0),
    "silver": (0.75, 0.75, 0.75, 1.0),
    "yellow": (1.0, 1.0, 0.0, 1.0),
    "green": (0.0, 0.5, 0.0, 1.0),
    "navy": (0.0, 0.0, 0.5, 1.0),
    "teal": (0.0, 0.5, 0.5, 1.0),
    "purple": (0.5, 0.0, 0.5, 1.0),
    "rose": (1.0, 0.0, 0.5, 1.0),
    "black": (0.0, 0.0, 0.0, 1.0),
}
TRIPLES = (
    ("olive", "orange", "azure"),
    ("gray", "silver", "azure"),
    ("yellow", "green", "azure"),
    ("green", "navy", "teal"),
    ("purple", "rose", "black"),
)
WORDS = ("color_a", "color_b", "color_other")
"""The right arm's button, the left arm's, and the one to leave alone; triples are in this order."""

RIGHT, LEFT, OTHER = "right_button", "left_button", "other_button"
AREAS = {
    RIGHT: PlacementArea((0.25, -0.200), half_size_m=(0.258, 0.2034), half_yaw_rad=np.pi),
    LEFT: PlacementArea((0.25, 0.225), half_size_m=(0.258, 0.2034), half_yaw_rad=np.pi),
    OTHER: PlacementArea((0.25, 0.0), half_size_m=(0.258, 0.339), half_yaw_rad=np.pi),
}
LEAST_DISTANCE_M = 0.15

HOVER_Z_M = 0.86
PRESS_Z_M = 0.775
"""Centre of a voxel, at which the fingertips would be 6 mm inside the base: the cap goes down all the way."""


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
        taxonomy=Taxonomy(
            temporal=True,
            spatial=False,
            physical=False,
            symmetric=True,
            synchronous=False,
            prehension=Prehension.NON_PREHENSILE,
        ),
        props=(Button(RIGHT), Button(LEFT), Button(OTHER)),
        success=(Pressed(RIGHT), Pressed(LEFT)),
        horizon_ticks=220,
        needs_both_arms=True,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """One button in each arm's half, the third anywhere, at any yaw."""
        poses = {name: area.sample(rng, TABLE_HEIGHT_M) for name, area in AREAS.items()}
        for (name, pose), color in zip(poses.items(), variation.words.values(), strict=True):
            scene.place(name, pose)
            scene.set_color(name, COLORS[color])
        return all(a.distance_to(b)[0] >= LEAST_DISTANCE_M for a, b in combinations(poses.values(), 2))

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Above, press."""
        left, right = scene.pose(LEFT).position[:2], scene.pose(RIGHT).position[:2]
        above, press = _hands(left, right, HOVER_Z_M), _hands(left, right, PRESS_Z_M)
        yield Stage("above", *above, left_open=False, right_open=False, planned=True)
        yield Stage("press", *press)


def _hands(left_xy: np.ndarray, right_xy: np.ndarray, height_m: float) -> tuple[Pose, Pose]:
    """Both hands pointing down, narrow side along y, so that hands over neighbouring buttons do not meet."""
    left = Pose.looking((*left_xy, height_m), approach=(0, 0, -1), opening=(1, 0, 0))
    right = Pose.looking((*right_xy, height_m), approach=(0, 0, -1), opening=(-1, 0, 0))
    return left, right
