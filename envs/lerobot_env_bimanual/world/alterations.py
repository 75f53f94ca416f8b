"""Changes of a compiled model: bodies, contacts, joints and motors for one episode, and what physics has to look at."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco

FIELDS = (
    "body_mass",
    "body_inertia",
    "geom_friction",
    "pair_friction",
    "jnt_stiffness",
    "qpos_spring",
    "dof_damping",
    "dof_frictionloss",
    "actuator_gainprm",
    "actuator_biasprm",
    "actuator_forcerange",
)
"""Fields of the model that may be altered; others follow from them."""


class Alterations:
    """Changed values of a model's fields, and the compiled ones to go back to."""

    def __init__(self, model: mujoco.MjModel):
        self._model = model
        self._compiled: dict[str, NDArray] = {}

    def values(self) -> dict[str, NDArray]:
        """The model's present values of `FIELDS`, if any is altered; they are views, to be read only."""
        return {field: getattr(self._model, field) for field in self._compiled}

    def apply(self, fields: Mapping[str, NDArray]) -> None:
        """Give some fields other values.

        Raises:
            ValueError: a field is not in `FIELDS`.
        """
        if others := fields.keys() - set(FIELDS):
            raise ValueError(f"{', '.join(sorted(others))} cannot be altered, only {', '.join(FIELDS)}")
        if fields:
            self._compiled = self._compiled or {field: getattr(self._model, field).copy() for field in FIELDS}
            self._set(fields)

    def revert(self) -> None:
        """Give all fields the values that were compiled."""
        if self._compiled:
            self._set(self._compiled)
            self._compiled = {}

    def _set(self, fields: Mapping[str, NDArray]) -> None:
        for field, values in fields.items():
            getattr(self._model, field)[:] = values
        mujoco.mj_setConst(self._model, mujoco.MjData(self._model))  # what follows from them


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
