"""Raise a block: a task in a distribution of its own.

The right arm takes a block off the table and holds it up, and the left one follows above it. `pyproject.toml` beside
this file announces it in the entry-point group `lerobot_bimanual.tasks`, by its name. Once that is installed, every
command, `--env.task` and Gymnasium know it:

    pip install --no-build-isolation --no-deps -e .
    lerobot-bimanual expert evaluate --task=raise_block --episodes=20
    lerobot-bimanual dataset generate --task=raise_block --episodes=20 --root=data/raise_block
"""

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Held
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import PlacementArea, Task, TaskSpec, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.scene_view import SceneView

BLOCK = Block("block", size_m=(0.04, 0.04, 0.08), mass_kg=0.1, rgba=(0.1, 0.4, 0.8, 1.0))
AREA = PlacementArea(center_m=(0.3, -0.2), half_size_m=(0.1, 0.1), half_yaw_rad=np.deg2rad(20.0))
DOWN = (0.0, 0.0, -1.0)


@register
class RaiseBlock(Task):
    """The right hand lifts the block while the left hand watches from above."""

    spec = TaskSpec(
        name="raise_block",
        instructions=("raise block",),
        suites=("asymmetric", "asynchronous", "prehensile"),
        props=(BLOCK,),
        success=(Held("block", by=Arm.RIGHT), Above("block", 0.95)),
        horizon_ticks=300,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        """Draw where the block stands."""
        scene.place("block", AREA.sample(rng, TABLE_HEIGHT_M + BLOCK.size_m[2] / 2))
        return True

    def script(self, scene: SceneView, variation: Variation) -> Iterator[Stage]:
        """Take the block by its sides, and lift it."""
        block = scene.pose("block")
        grasp = Pose.looking((*block.position[:2], 0.815), approach=DOWN, opening=block.rotation[:, 1])
        watch = Pose.looking((0.2, 0.2, 1.1), approach=DOWN, opening=(0, 1, 0))
        yield Stage("hover", left=watch, right=grasp.translated((0, 0, 0.1)), planned=True)
        yield Stage("grasp", right=grasp, right_open=False, right_holds="block")
        yield Stage("lift", right=grasp.translated((0, 0, 0.25)))
