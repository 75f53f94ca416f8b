"""Who touches whom, by subtrees of bodies."""

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
