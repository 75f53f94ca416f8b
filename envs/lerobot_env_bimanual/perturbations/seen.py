"""Axes that change what cameras measure: their poses, noise and holes of their images, cameras that fail."""

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import DTypeLike, NDArray

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.geometry.rotations import quat_wxyz_from_axis_angle, quat_wxyz_multiply
from lerobot_env_bimanual.perturbations.axis import Axis, HookContext, Image, Start, data, register
from lerobot_env_bimanual.world.appearance import Appearance

CM_PER_M = 100

NOISE_OFFSETS = 2**16
"""Number of places in the table of noise where an image's noise may begin."""
GAMMA = 2.2
"""Of the encoding from light to grey values."""
SIGMA_PER_STOP = 12
"""Noise of colours per stop of exposure, of 255 grey values."""
STEPS_PER_GREY = 64
"""Fixed-point steps of a grey value: arithmetic in 16 bits is fast."""

MAX_SLANT_DEG = 90
LOST_SLANT_DEG = 30
"""At magnitude 1 the largest slant that is still measured is this much smaller."""
EDGE_SHARE = 1 / 85
"""Share of an image's height that is lost beside an edge at magnitude 1: three pixels of 256."""
MAX_DARK = 60
"""At magnitude 1 pixels whose channels are all at most this, of 255, are too dark to be measured."""

ALWAYS_SEEN, *MAY_FAIL = CAMERA_NAMES
"""A policy without any image refuses to act, so `front` never fails; if it is not observed, one other camera does not fail."""


def _move_cameras(start: Start, appearance: Appearance, *, calibrated: bool) -> Appearance:
    """Turn each camera about a drawn axis by the magnitude in degrees, and shift it by as many centimetres."""
    model = start.scene.model
    directions = start.rng.normal(size=(2, model.ncam, 3))
    axes, shifts_m = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    shifts_m *= start.magnitude / CM_PER_M
    turns_wxyz = quat_wxyz_from_axis_angle(axes, np.deg2rad(start.magnitude))

    def moved(fields: Mapping[str, NDArray]) -> dict[str, NDArray]:
        quat_wxyz, position_m = fields.get("cam_quat", model.cam_quat), fields.get("cam_pos", model.cam_pos)
        return {"cam_quat": quat_wxyz_multiply(quat_wxyz, turns_wxyz), "cam_pos": position_m + shifts_m}

    worn = appearance.with_fields(**moved(appearance.fields))
    return replace(worn, calibration=moved(appearance.calibration)) if calibrated else worn


def _normal(shape: tuple[int, ...], sigma: float, rng: np.random.Generator, dtype: DTypeLike) -> NDArray:
    """Normally distributed numbers, read only: cut from a table, as drawing them anew would cost as much as an image."""
    count, begin = math.prod(shape), int(rng.integers(NOISE_OFFSETS))
    return _noise_table(count, sigma, np.dtype(dtype))[begin : begin + count].reshape(shape)


@lru_cache(maxsize=16)
def _noise_table(count: int, sigma: float, dtype: np.dtype) -> NDArray:
    """The same numbers in every process."""
    numbers = np.random.default_rng(0).standard_normal(NOISE_OFFSETS + count, dtype=np.float32)
    numbers = numbers * np.float32(sigma)
    return np.rint(numbers).astype(dtype) if np.issubdtype(dtype, np.integer) else numbers.astype(dtype)


def _draw_exposures(start: Start[dict[str, int]]) -> None:
    """Draw which cameras are exposed too long (1), and which too short (-1)."""
    signs = start.rng.choice((-1, 1), size=len(CAMERA_NAMES))
    start.remember(dict(zip(CAMERA_NAMES, signs.tolist(), strict=True)))


def _expose(context: HookContext[dict[str, int]], camera: str, image: Image) -> Image:
    rgb, depth_m = image
    gain = 2 ** (context.memory[camera] * context.magnitude / GAMMA)
    values = rgb.astype(np.int16)
    values *= round(gain * STEPS_PER_GREY)
    values += _normal(rgb.shape, SIGMA_PER_STOP * context.magnitude * STEPS_PER_GREY, context.rng, np.int16)
    np.clip(values, 0, STEPS_PER_GREY * 256 - 1, out=values)
    greys = values.view(np.uint16)  # NumPy divides unsigned numbers twice as fast
    greys //= STEPS_PER_GREY
    return greys.astype(np.uint8), depth_m


def _add_depth_noise(context: HookContext, camera: str, image: Image) -> Image:
    """Add noise; depth that was not measured stays 0."""
    rgb, depth_m = image
    depth_m += np.square(depth_m) * _normal(depth_m.shape, context.magnitude, context.rng, np.float32)
    return rgb, depth_m


def _note_slopes(start: Start[dict[str, float]]) -> None:
    """Note the largest measured change of depth from one pixel to the next, per m of depth and image height."""
    model = start.scene.model
    steepest = math.tan(math.radians(MAX_SLANT_DEG - LOST_SLANT_DEG * start.magnitude))
    half_fovys = {name: math.radians(model.camera(name).fovy.item() / 2) for name in CAMERA_NAMES}
    start.remember({name: steepest * 2 * math.tan(half) for name, half in half_fovys.items()})


def _lose_depth(context: HookContext[dict[str, float]], camera: str, image: Image) -> Image:
    """Set depth to 0 where it is lost. An edge is a very slanted surface between two pixels, so one rule finds both."""
    rgb, depth_m = image
    height, width = depth_m.shape
    step = max(1, round(context.magnitude * EDGE_SHARE * height))
    most = np.float32(context.memory[camera] * step / height)
    # NumPy processes an image as one flat array several times as fast as row by row.
    lost, line = _is_dark(rgb, round(context.magnitude * MAX_DARK)), depth_m.reshape(-1)
    squared_change_m2 = np.zeros_like(line)
    for back in (step, step * width):  # differences along rows and along columns give the gradient's length
        squared_change_m2[back:] += np.square(line[back:] - line[:-back])
    lost |= squared_change_m2 > np.square(line * most)
    lost = lost.reshape(depth_m.shape)
    lost[:, :step] = True  # the second eye sees nothing beyond this edge of the image
    depth_m *= ~lost
    return rgb, depth_m


def _is_dark(rgb: NDArray[np.uint8], darkest: int) -> NDArray[np.bool_]:
    """(height x width,) pixels without a channel above a value."""
    line = rgb.reshape(-1)
    brightest = np.maximum(line[:-2], line[1:-1])
    np.maximum(brightest, line[2:], out=brightest)
    return brightest[::3].copy() <= darkest


def _draw_failing(start: Start[list[str]]) -> None:
    drawn = [camera for camera in start.rng.permutation(MAY_FAIL).tolist() if camera in start.cameras]
    start.remember(drawn[: min(int(start.magnitude), len(start.cameras) - 1)])


def _black_out(context: HookContext[list[str]], camera: str, image: Image) -> Image:
    if camera in context.memory:
        for values in image:
            values[:] = 0
    return image


register(Axis(**data("camera_moved"), look=partial(_move_cameras, calibrated=True)))
register(Axis(**data("camera_miscalibrated"), look=partial(_move_cameras, calibrated=False)))
register(Axis(**data("colour_noise"), begin=_draw_exposures, see=_expose))
register(Axis(**data("depth_noise"), see=_add_depth_noise))
register(Axis(**data("depth_holes"), begin=_note_slopes, see=_lose_depth))
register(Axis(**data("fewer_cameras"), begin=_draw_failing, see=_black_out))
