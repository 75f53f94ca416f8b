"""Both handovers without a handover: the left hand puts the item down in the middle, the right hand picks it up."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from adversaries.hand import Moves
from adversaries.ways import Way
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.baselines import play_script
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.tasks._handover import grasp_axis
from lerobot_env_bimanual.world.scene_view import SceneView

DOWN = (0, 0, -1)
MIDDLE_XY_M = (0.27, 0.0)
WAIT_M = (0.45, -0.15, TABLE_HEIGHT_M + 0.25)


def ways(env: BimanualEnv, arm: Arm) -> Iterator[Way]:
    """One way, the same for either arm: both arms take part, but never together."""
    yield _put_down


def _put_down(env: BimanualEnv) -> Moves:
    item = next(prop for prop in env.task_definition.spec.props if isinstance(prop, Block))
    return play_script(env, partial(_script, item=item.name, half_m=item.size_m[2] / 2))


def _script(scene: SceneView, item: str, half_m: float) -> Iterator[Stage]:
    """Grasp, put down, leave; swap, grasp, raise."""
    pose, above = scene.pose(item), np.array((0, 0, 0.4 * half_m))
    grasp = Pose.looking(pose.position + above, DOWN, grasp_axis(pose))
    put = Pose.looking((*MIDDLE_XY_M, TABLE_HEIGHT_M + 1.4 * half_m + 0.003), DOWN, (1, 0, 0))
    yield Stage("hover", left=grasp.translated((0, 0, 0.1)), left_open=True, planned=True)
    yield Stage("grasp", left=grasp, left_open=False, left_holds=item)
    yield Stage("lift", left=grasp.translated((0, 0, 0.08)))
    yield Stage("over", put.translated((0, 0, 0.05)), Pose.looking(WAIT_M, DOWN, (0, 1, 0)))
    yield Stage("put", left=put, left_open=True)
    yield Stage("leave", left=put.translated((0, 0, 0.12)))
    now = scene.pose(item)
    sides = np.concatenate([now.rotation[:, :2].T, -now.rotation[:, :2].T])
    take = Pose.looking(now.position + above, DOWN, sides[sides[:, 1].argmax()])
    yield Stage("swap", put.translated((-0.25, 0.05, 0.2)), take.translated((0, 0, 0.1)))
    yield Stage("take", right=take, right_open=False, right_holds=item)
    yield Stage("raise", right=take.translated((0, 0, 0.12)))
