"""Differences between a model and how it looks in one episode, true camera poses included."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property

from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco

FOLLOWING = ("cam_xpos", "cam_xmat", "light_xpos", "light_xdir")
"""Data fields that follow from where cameras and lights are fixed."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """Values of a model's fields that are used for images alone.

    They are in the model only while images are made, so that neither physics nor a state hash can depend on them.

    Attributes:
        fields: name of a model's field -> all its values.
        calibration: values of the camera fields that the calibration reports where they differ from the model.
        casts_shadows: whether lights cast shadows in images of every quality.
    """

    fields: Mapping[str, NDArray] = field(default_factory=dict)
    calibration: Mapping[str, NDArray] = field(default_factory=dict)
    casts_shadows: bool = False

    def with_fields(self, **fields: NDArray) -> Appearance:
        """This appearance with other values of some fields, each in the model's shape."""
        return replace(self, fields={**self.fields, **fields})

    @cached_property
    def fingerprint(self) -> bytes:
        """Equal for appearances whose images are equal, so that what has been drawn can be kept."""
        return b"".join(name.encode() + values.tobytes() for name, values in sorted(self.fields.items()))


NOMINAL = Appearance()


@contextmanager
def applied(model: mujoco.MjModel, data: mujoco.MjData, fields: Mapping[str, NDArray]) -> Iterator[None]:
    """Give a model other values of some fields while the `with` block runs; in `data` cameras and lights move along."""
    if not fields:
        yield
        return
    kept = {name: getattr(model, name).copy() for name in fields}
    followed = {name: getattr(data, name).copy() for name in FOLLOWING}
    try:
        for name, values in fields.items():
            getattr(model, name)[:] = values
        mujoco.mj_camlight(model, data)
        yield
    finally:
        for name, values in kept.items():
            getattr(model, name)[:] = values
        for name, values in followed.items():
            getattr(data, name)[:] = values
