"""Add a task of your own: props, conditions, a placement and a script; everything else comes with it.

    python examples/04_add_a_task.py

Here the right arm takes a block off the table and holds it up, and the left one follows above it. A task of this
package is the same code in a file of `lerobot_env_bimanual/tasks/`; then the tests, the list of tasks and the
environment's flags know it too.
"""

from collections.abc import Iterator

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.conditions import Above, Held
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert.runner import run_expert
from lerobot_env_bimanual.placement import PlacementArea
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Prehension, Task, TaskSpec, Taxonomy, Variation
from lerobot_env_bimanual.tasks.registry import register
from lerobot_env_bimanual.world.scene import Scene

BLOCK = Block("block", size_m=(0.04, 0.04, 0.08), mass_kg=0.1, rgba=(0.1, 0.4, 0.8, 1.0))
AREA = PlacementArea(center_m=(0.3, -0.2), half_size_m=(0.1, 0.1), half_yaw_rad=np.deg2rad(20.0))
DOWN = (0.0, 0.0, -1.0)


@register
class RaiseBlock(Task):
    """The right hand lifts the block while the left hand watches from above."""

    spec = TaskSpec(
        name="raise_block",
        id=100,  # part of every seed; the package's own tasks use 0 to 12
        instructions=("raise the block",),
        variations=(Variation(),),
        taxonomy=Taxonomy(
            temporal=False,
            spatial=False,
            physical=False,
            symmetric=False,
            synchronous=False,
            prehension=Prehension.PREHENSILE,
        ),
        props=(BLOCK,),
        success=(Held("block", by=Arm.RIGHT), Above("block", 0.95)),
        horizon_ticks=300,
    )

    def place(self, scene: Scene, variation: Variation, rng: np.random.Generator) -> bool:
        scene.place("block", AREA.sample(rng, TABLE_HEIGHT_M + BLOCK.size_m[2] / 2))
        return True

    def script(self, scene: Scene, variation: Variation) -> Iterator[Stage]:
        block = scene.pose("block")
        grasp = Pose.looking((*block.position[:2], 0.815), approach=DOWN, opening=block.rotation[:, 1])
        watch = Pose.looking((0.2, 0.2, 1.1), approach=DOWN, opening=(0, 1, 0))
        yield Stage("hover", left=watch, right=grasp.translated((0, 0, 0.1)), planned=True)
        yield Stage("grasp", right=grasp, right_open=False, right_holds="block")
        yield Stage("lift", right=grasp.translated((0, 0, 0.25)))


env = BimanualEnv("raise_block", obs="state")
for codec in (None, KeyposeCodec()):
    outcomes = [run_expert(env, seed, codec) for seed in range(5)]
    keyposes = "exact keyposes" if codec is None else "keyposes rounded to 1 cm and 5 degrees"
    print(f"{keyposes}: {sum(outcome.success for outcome in outcomes)} of 5 solved")
    for outcome in outcomes:
        if not outcome.success:
            print(f"  seed {outcome.seed}: {outcome.failure} at {outcome.last_move!r}, unmet {outcome.unmet}")
env.close()
