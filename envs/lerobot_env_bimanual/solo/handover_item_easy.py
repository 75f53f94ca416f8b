"""Hand over the item, alone: the receiver picks it up itself."""

from collections.abc import Iterator
from functools import partial

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.solo._picking import base_of, grips
from lerobot_env_bimanual.solo.handover_item import pick_up
from lerobot_env_bimanual.solo.ways import Way
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.world.scene_view import SceneView

BEHIND_M = 0.0


def ways(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Way]:
    """From above if the arm reaches so far, otherwise with a tilted hand."""
    for grip in grips(scene.pose("item"), base_of(scene, arm)):
        yield partial(pick_up, arm=arm, item="item", grip=grip, behind_m=BEHIND_M)
