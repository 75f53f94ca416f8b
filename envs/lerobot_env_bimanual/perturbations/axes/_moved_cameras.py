"""Cameras that are not where they were, whether their calibration knows it or not."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle, quat_wxyz_multiply
from lerobot_env_bimanual.gl import mujoco
from lerobot_env_bimanual.world.appearance import Appearance

CM_PER_M = 100


def move_cameras(
    model: mujoco.MjModel, appearance: Appearance, magnitude: float, rng: np.random.Generator, *, told: bool
) -> Appearance:
    """Turn each camera by `magnitude` degrees about a random axis, and move it by as many centimetres.

    Args:
        model: of the scene.
        appearance: so far.
        magnitude: degrees and centimetres.
        rng: draws two directions for each camera.
        told: whether the calibration knows of it.
    """
    directions = rng.normal(size=(2, model.ncam, 3))
    turns, shifts_m = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    shifts_m *= magnitude / CM_PER_M
    turned = _moved(model, appearance.fields, turns, np.deg2rad(magnitude), shifts_m)
    appearance = appearance.wearing(**turned)
    if told:
        known = _moved(model, appearance.calibration, turns, np.deg2rad(magnitude), shifts_m)
        appearance = appearance.calibrated(**known)
    return appearance


def _moved(
    model: mujoco.MjModel, fields: Mapping[str, NDArray], turns: NDArray, angle_rad: float, shifts_m: NDArray
) -> dict[str, NDArray]:
    """Poses of all cameras, as these fields have them or else the model, turned about unit axes and shifted (n, 3)."""
    quat_wxyz = fields.get("cam_quat", model.cam_quat)
    position_m = fields.get("cam_pos", model.cam_pos)
    turn_wxyz = quat_wxyz_from_axis_angle(turns, angle_rad)
    return {"cam_quat": quat_wxyz_multiply(quat_wxyz, turn_wxyz), "cam_pos": position_m + shifts_m}
