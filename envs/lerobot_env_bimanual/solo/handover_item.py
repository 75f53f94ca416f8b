"""Hand over the item, alone: the receiver picks it up itself."""

from collections.abc import Iterator
from functools import partial

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.solo._picking import Grip, base_of, grips
from lerobot_env_bimanual.solo.ways import Way, alone
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.handover_item import TARGET
from lerobot_env_bimanual.world.scene_view import SceneView

HOVER_M = 0.10
BEHIND_M = 0.005
LIFT_M = 0.12


def ways(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Way]:
    """From above if the arm reaches so far, otherwise with a tilted hand."""
    for grip in grips(scene.pose(TARGET), base_of(scene, arm)):
        yield partial(pick_up, arm=arm, item=TARGET, grip=grip, behind_m=BEHIND_M)


def pick_up(scene: SceneView, arm: Arm, item: str, grip: Grip, behind_m: float) -> Iterator[Stage]:
    """Before it, around it, up."""
    grasp = grip.at(scene.pose(item).position).advanced(-behind_m)
    yield alone(arm, "before", grasp.advanced(-HOVER_M), is_open=True, planned=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds=item)
    yield alone(arm, "lift", grasp.translated((0, 0, LIFT_M)))
