"""Pick up the plate, alone: a steep hand pinches the sloping rim where it lies."""

from collections.abc import Iterator
from functools import partial
from itertools import product

import numpy as np

from adversaries._picking import base_of
from adversaries.single_arm import Strategy, alone
from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.stage import Stage
from lerobot_env_bimanual.task import Variation
from lerobot_env_bimanual.tasks.pick_plate import PLATE
from lerobot_env_bimanual.world.scene_view import SceneView

BEFORE_M = 0.10
HALF_OPEN_M, FINGERTIP_M, CORNER_M = 0.048, 0.010, 0.002
"""From the tool centre point sideways to the outside of an open finger, and ahead to its tip; and room below."""
LIFT_M, RAISE_M = 0.10, 0.30


def strategies(scene: SceneView, variation: Variation, arm: Arm) -> Iterator[Strategy]:
    """The near side of the rim, with a hand that is more or less steep, more or less far inside."""
    for slope_deg, inside_m in product((70.0, 60.0), (0.03, 0.02, 0.01)):
        yield partial(_pinch, arm=arm, slope_rad=np.deg2rad(slope_deg), inside_m=inside_m)


def _pinch(scene: SceneView, arm: Arm, slope_rad: float, inside_m: float) -> Iterator[Stage]:
    """Before the rim, around it with one finger over it and the other one as low as the table allows, up."""
    plate, up = scene.pose("plate").position, np.array((0.0, 0.0, 1.0))
    ahead = (plate - base_of(scene, arm)) * (1, 1, 0)
    ahead /= np.linalg.norm(ahead)
    sin, cos = np.sin(slope_rad), np.cos(slope_rad)
    x, y, table_z = plate - (PLATE.radius_m - inside_m) * ahead
    z = table_z + HALF_OPEN_M * cos + FINGERTIP_M * sin + CORNER_M
    grasp = Pose.looking((x, y, z), approach=cos * ahead - sin * up, opening=cos * up + sin * ahead)
    yield alone(arm, "before", grasp.advanced(-BEFORE_M), is_open=True)
    yield alone(arm, "grasp", grasp, is_open=False, holds="plate")
    yield alone(arm, "lift", grasp.translated(LIFT_M * up))
    yield alone(arm, "raise", grasp.translated(RAISE_M * up))
