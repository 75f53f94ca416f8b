"""Hand over the item, alone: the receiver picks it up itself, or rakes it nearer first."""

from collections.abc import Iterator

from adversaries.handover_item import pick_or_rake
from adversaries.single_arm import Strategy
from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.handover_item_easy import ITEM
from lerobot_env_bimanual.world.scene_view import SceneView

BEHIND_M = 0.0


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """From above if the arm reaches so far, otherwise with a tilted hand, otherwise after raking it nearer."""
    return pick_or_rake(scene, arm, ITEM.name, ITEM.size_m[2] / 2, BEHIND_M)
