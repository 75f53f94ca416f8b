"""Which joints belong to things: doors, drawers, buttons, lids, and what bends."""

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.world.scene_view import SceneView

HINGED = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
OF_ARMS = {name for arm in ARMS for name in (*PANDA_PAIR.joint_names(arm), *PANDA_PAIR.finger_names(arm))}


def has_joints(model: mujoco.MjSpec) -> bool:
    """Whether a thing has one in a world that is not compiled yet."""
    return any(joint.type in HINGED and joint.name not in OF_ARMS for joint in model.joints)


def joints_of_things(scene: SceneView) -> NDArray[np.bool_]:
    """(njnt,) hinges and slides that are not the arms'."""
    model = scene.model
    bases = [model.body(scene.arm_pair.base_body(arm)).id for arm in ARMS]
    return np.isin(model.jnt_type, HINGED) & ~np.isin(model.body_rootid[model.jnt_bodyid], bases)
