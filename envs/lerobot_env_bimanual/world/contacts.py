"""What physics has to look at to find the contacts of a model."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco


def solid_geom_counts(model: mujoco.MjModel) -> NDArray[np.int32]:
    """How many geoms (nbody,) of each body physics has to look at: those of the arms only up to the last that collides.

    MuJoCo moves all geoms of a body, and bounds it by them, before it looks for contacts, at every step. With these
    counts in `body_geomnum` it leaves out the arms' shells, which are only seen and come last, and finds the same
    contacts. Two geoms of several are kept, as contacts between single ones come in another order. Props keep all: what
    falls asleep is not moved again, so its last step has to move the whole.
    """
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    collides[model.pair_geom1] = collides[model.pair_geom2] = True
    geoms = np.flatnonzero(collides)
    bodies = model.geom_bodyid[geoms]
    counts = np.minimum(model.body_geomnum, 2)
    np.maximum.at(counts, bodies, geoms + 1 - model.body_geomadr[bodies])
    never_sleeps = model.tree_sleep_policy == mujoco.mjtSleepPolicy.mjSLEEP_AUTO_NEVER
    is_of_arm = (model.body_treeid >= 0) & never_sleeps[model.body_treeid]
    return np.where(is_of_arm, counts, model.body_geomnum)
