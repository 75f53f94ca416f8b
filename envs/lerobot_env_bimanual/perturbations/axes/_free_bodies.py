"""Which bodies of a world move freely: what the arms handle, with all that hangs on it."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco

FREE = mujoco.mjtJoint.mjJNT_FREE


def has_free_bodies(model: mujoco.MjSpec) -> bool:
    """Whether a world that is not compiled yet has one."""
    return any(joint.type == FREE for joint in model.joints)


def free_bodies(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """(nbody,) bodies with a free joint, and those below them."""
    is_free = np.zeros(model.nbody, dtype=bool)
    is_free[model.jnt_bodyid[model.jnt_type == FREE]] = True
    for body in range(1, model.nbody):  # parents come first
        is_free[body] |= is_free[model.body_parentid[body]]
    return is_free
