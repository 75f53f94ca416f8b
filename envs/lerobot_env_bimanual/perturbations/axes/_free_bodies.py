"""Which bodies of a world move freely: what the arms handle, with all that hangs on it."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco

FREE = mujoco.mjtJoint.mjJNT_FREE
DISTRACTOR = "distractor"
"""Begins the names of bodies that nobody handles."""


def free_roots_of(model: mujoco.MjSpec) -> list[mujoco.MjsBody]:
    """Bodies with a free joint in a world that is not compiled yet."""
    bodies = (joint.parent for joint in model.joints if joint.type == FREE)
    return [body for body in bodies if not body.name.startswith(DISTRACTOR)]


def has_free_bodies(model: mujoco.MjSpec) -> bool:
    """Whether a world that is not compiled yet has one."""
    return bool(free_roots_of(model))


def free_roots(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Indices of the bodies with a free joint."""
    roots = model.jnt_bodyid[model.jnt_type == FREE]
    is_handled = [not model.body(root).name.startswith(DISTRACTOR) for root in roots]
    return roots[np.array(is_handled, dtype=bool)].astype(np.intp)


def free_bodies(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """(nbody,) bodies with a free joint, and those below them."""
    return np.isin(model.body_rootid, free_roots(model))
