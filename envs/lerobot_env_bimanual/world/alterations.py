"""Changes of a compiled model: bodies, contacts, joints and motors for one episode."""

from collections.abc import Mapping

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
