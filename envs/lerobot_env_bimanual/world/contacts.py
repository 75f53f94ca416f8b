"""Contacts between subtrees of bodies."""

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco


class ContactQueries:
    """Contact questions about one model; the geoms of each asked-for subtree are looked up once."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        self._model = model
        self._data = data
        self._geoms_of: dict[str, NDArray[np.bool_]] = {}

    def geoms(self, body: str) -> NDArray[np.bool_]:
        """Mask (ngeom,) of the geoms on a body and all bodies below it."""
        if body not in self._geoms_of:
            in_subtree = np.zeros(self._model.nbody, dtype=bool)
            in_subtree[self._model.body(body).id] = True
            for child, parent in enumerate(self._model.body_parentid):  # parents come before children
                in_subtree[child] |= in_subtree[parent]
            self._geoms_of[body] = in_subtree[self._model.geom_bodyid]
        return self._geoms_of[body]

    def between(self, body_a: str, body_b: str) -> bool:
        """Whether any geom of one subtree touches any geom of the other."""
        a, b = self.geoms(body_a), self.geoms(body_b)
        first, second = self._data.contact.geom.reshape(-1, 2).T
        return bool(np.any((a[first] & b[second]) | (b[first] & a[second])))


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
