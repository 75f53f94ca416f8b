"""Whether a hand may have to push something heavy: its own speed is then not all that it has to bring up."""

import numpy as np

from lerobot_bimanual.arms import Arm
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.motion.carrying import is_free
from lerobot_env_bimanual.world.scene_view import SceneView

HEAVY_KG = 20.0
"""From which on a thing takes more force to be set in motion than to be kept there."""
BESIDE_M = 0.03
"""From a hand; as far as rounded keyposes may be off, and more."""


def is_beside_heavy(scene: SceneView, arm: Arm) -> bool:
    """Whether a hand is within `BESIDE_M` of a free thing of at least `HEAVY_KG`."""
    model, data = scene.model, scene.data
    heavy = [body for body in np.flatnonzero(model.body_subtreemass >= HEAVY_KG) if is_free(model, body)]
    if not heavy:
        return False
    hand = [
        model.body(name).id for name in (scene.arm_pair.hand_body(arm), *scene.arm_pair.finger_names(arm))
    ]
    touchable = (model.geom_contype | model.geom_conaffinity) != 0
    of_hand, of_heavy = (
        np.flatnonzero(np.isin(model.geom_bodyid, bodies) & touchable).tolist() for bodies in (hand, heavy)
    )
    return any(
        mujoco.mj_geomDistance(model, data, one, other, BESIDE_M, None) < BESIDE_M
        for one in of_hand
        for other in of_heavy
    )
