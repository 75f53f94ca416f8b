"""How limp things lie on the table once they have come to rest, found once per process instead of at every reset."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.pose import Pose
from lerobot_bimanual.geometry.workspace import TABLE_HEIGHT_M
from lerobot_env_bimanual.props.prop import Prop
from lerobot_env_bimanual.world.arena import TABLE_CENTRE_XY_M
from lerobot_env_bimanual.world.scene import Scene

MAX_TICKS = 40


@cache
def at_rest(prop: Prop, height_m: float) -> tuple[Pose, NDArray[np.float64]]:
    """Lay a thing down on an empty table, and wait until it sleeps.

    Args:
        prop: it moves freely and has joints.
        height_m: of its root above the table, where it is laid down.

    Returns:
        Its root's pose at rest in the frame of where it was laid, and the values of its joints, in the model's order.
    """
    scene = Scene((prop,))
    laid = Pose.upright((*TABLE_CENTRE_XY_M, TABLE_HEIGHT_M + height_m))
    scene.place(prop.name, laid)
    scene.settle(MAX_TICKS)
    return laid.inverse() @ scene.pose(prop.name), scene.joints_below(prop.name)
