"""Check that an observation is complete, in the units of the schema, and of the cameras of its calibration.

A network answers any input with a keypose. What cannot be true is an error that names the flag that mends it; what only
differs from the training is a warning, given once.
"""

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.schema import (
    CAMERA_INTRINSICS,
    DEPTH_MIN_M,
    MM_PER_M,
    VECTORS,
    depth_key,
    image_key,
)
from lerobot_policy_bimanual.errors import BadObservation
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig

MIN_PLAUSIBLE_DEPTH_MM = 20.0
"""No scene is as near as this, and no depth in metres is as large."""

ROUNDING_MM = 1e-3
"""Datasets store `DEPTH_MIN_M`, up to this, where nothing was measured."""

RGB_TOLERANCE = 0.01
"""Overshoot beyond 0 and 1 that resampling may cause."""

MAX_OFF_CENTRE = 0.05
"""Largest distance of a principal point from the middle of the image, as a share of the image's side."""

_log = logging.getLogger(__name__)


class ObservationCheck:
    """Checks the observations of one policy, and remembers which warnings were given.

    Args:
        config: says which cameras the policy reads, of which size, and which instructions it was trained with.
    """

    def __init__(self, config: KeyposePolicyConfig):
        self._config = config
        self._warned: set[str] = set()

    def __call__(self, batch: Mapping[str, Any]) -> None:
        """Check a batch as `keypose.observation.observe` takes it; numbers travel from the device once.

        Raises:
            BadObservation: something is missing, of another shape, or cannot be true.
        """
        _check_shapes(batch, self._config)
        depth_mm, rgb, vectors = _extremes(batch, self._config)
        largest_mm = depth_mm[..., 1]  # (cameras, b)
        is_empty = (largest_mm <= 0) | (np.abs(largest_mm - DEPTH_MIN_M * MM_PER_M) < ROUNDING_MM)
        for index, camera in enumerate(self._config.cameras):
            lowest, largest = depth_mm[index, :, 0].min(), depth_mm[index, :, 1].max()
            if lowest < 0 or (largest < MIN_PLAUSIBLE_DEPTH_MM and not is_empty[index].all()):
                raise BadObservation(
                    f"{depth_key(camera)} goes from {lowest:.4g} to {largest:.4g}, but depth must be in millimetres along "
                    "the optical axis. LeRobot's datasets give metres with --dataset.depth_output_unit=m: leave it out"
                )
            if not (rgb[index, :, 0].min() >= -RGB_TOLERANCE and rgb[index, :, 1].max() <= 1 + RGB_TOLERANCE):
                raise BadObservation(
                    f"{image_key(camera)} goes from {rgb[index, :, 0].min():.4g} to {rgb[index, :, 1].max():.4g}, but RGB "
                    "must be from 0 to 1: divide 0..255 by 255 once, and leave normalisation to the policy"
                )
            _check_principal_point(camera, vectors[CAMERA_INTRINSICS], batch[image_key(camera)].shape[-2:])
        if is_empty.all(axis=0).any():
            raise BadObservation(
                f"no camera has any depth (all zero, NaN or infinite): {', '.join(self._config.cameras)}. A policy "
                "that sees nothing must not act"
            )
        # The cloud is made of all cameras, and real cameras drop images: one empty image is a warning only.
        for camera, empty in zip(self._config.cameras, np.atleast_1d(is_empty.any(axis=1)), strict=True):
            if empty:
                self._warn(f"{depth_key(camera)} has no depth at all (zero, NaN or infinite): is it on?")
        self._compare_with_training(batch)

    def _compare_with_training(self, batch: Mapping[str, Any]) -> None:
        for camera in self._config.cameras:
            feature = (self._config.input_features or {}).get(image_key(camera))
            size = tuple(batch[image_key(camera)].shape[-2:])
            if feature is not None and (trained := tuple(feature.shape[-2:])) != size:
                self._warn(
                    f"this policy was trained with images of {trained[0]} x {trained[1]} pixels, but {camera} has "
                    f"{size[0]} x {size[1]}. lerobot-eval gives the size of the training with "
                    f"--env.image_size={trained[0]}x{trained[1]}"
                )
                break
        known = self._config.trained_instructions
        if known and (unknown := [text for text in batch["task"] if text not in known]):
            shown = ", ".join(map(repr, known[:3])) + (", ..." if len(known) > 3 else "")
            self._warn(
                f"this policy was never trained with {unknown[0]!r}, but with {shown}: is it another task (--env.task)?"
            )

    def _warn(self, message: str) -> None:
        if message not in self._warned:
            self._warned.add(message)
            _log.warning(message)


def _check_shapes(batch: Mapping[str, Any], config: KeyposePolicyConfig) -> None:
    """Check what can be told without fetching a number from the device."""
    if missing := [key for key in (*config.observation_keys, "task") if key not in batch]:
        found = ", ".join(sorted(str(key) for key in batch if str(key).startswith("observation.")))
        raise BadObservation(
            f"the observation lacks {', '.join(missing)}, which the policy reads. lerobot-eval gives images with "
            f"--env.obs=rgbd --env.cameras={','.join(config.cameras)}, `task` is --task of LeRobot's rollout, and "
            f"other names are mapped with --rename_map. It has {found or 'no observation at all'}"
        )
    instructions = batch["task"]
    if not isinstance(instructions, list | tuple) or not all(isinstance(text, str) for text in instructions):
        raise BadObservation(
            f"`task` is {instructions!r:.80}, but must be a list of one instruction per sample"
        )
    shapes = {key: (len(instructions), len(VECTORS[key])) for key in config.vector_keys}
    for camera in config.cameras:
        pixels = tuple(getattr(batch[image_key(camera)], "shape", ()))[-2:]
        shapes[image_key(camera)] = (len(instructions), 3, *pixels)
        shapes[depth_key(camera)] = (len(instructions), 1, *pixels)
    for key, shape in shapes.items():
        found = tuple(getattr(batch[key], "shape", ()))
        # LeRobot's loader drops the last axis of what is one number per sample.
        if not isinstance(batch[key], Tensor) or (found != shape and (*found, 1) != shape) or 0 in shape:
            raise BadObservation(
                f"{key} is a {type(batch[key]).__name__} of the shape {found}, but must be a tensor of the shape {shape}, "
                f"as there are {len(instructions)} instructions; depth must be aligned to colour"
            )
    for key in map(image_key, config.cameras):
        if not batch[key].is_floating_point():
            raise BadObservation(
                f"{key} holds {batch[key].dtype}, but must hold floats from 0 to 1: divide by 255"
            )


def _extremes(
    batch: Mapping[str, Any], config: KeyposePolicyConfig
) -> tuple[NDArray[np.floating], NDArray[np.floating], dict[str, NDArray[np.floating]]]:
    """Fetch from the device what is checked.

    Returns:
        Smallest and largest depth and colour (cameras, b, 2) of every sample, without pixels that have no depth; and the
        vectors (b, n) by key.

    Raises:
        BadObservation: a vector holds NaN or infinity.
    """
    extremes = []
    for camera in config.cameras:
        depth_mm = batch[depth_key(camera)].float().flatten(1).nan_to_num(nan=0, posinf=0)
        rgb = batch[image_key(camera)].float().flatten(1)
        # On a CPU amin and amax are many times faster than aminmax.
        extremes.append(torch.stack([depth_mm.amin(1), depth_mm.amax(1), rgb.amin(1), rgb.amax(1)], dim=1))
    keys, samples = config.vector_keys, len(batch["task"])
    vectors = torch.cat([batch[key].float().reshape(samples, -1) for key in keys], dim=1)
    images = torch.stack(extremes)
    on_host = torch.cat([images.flatten(), vectors.flatten()]).detach().cpu().numpy()
    ends = np.cumsum([len(VECTORS[key]) for key in keys])[:-1]
    parts = np.split(on_host[images.numel() :].reshape(samples, -1), ends, axis=1)
    for key, values in zip(keys, parts, strict=True):
        if not np.isfinite(values).all():
            raise BadObservation(f"{key} holds NaN or infinity, but must hold finite numbers")
    depth_mm, rgb = np.split(on_host[: images.numel()].reshape(images.shape), 2, axis=-1)
    return depth_mm, rgb, dict(zip(keys, parts, strict=True))


def _check_principal_point(camera: str, intrinsics: NDArray[np.floating], size: tuple[int, int]) -> None:
    matrices = intrinsics.reshape(-1, len(CAMERA_NAMES), 3, 3)[:, CAMERA_NAMES.index(camera)]
    for pixels, centres in zip(size, (matrices[:, 1, 2], matrices[:, 0, 2]), strict=True):
        if (np.abs(centres - pixels / 2) > MAX_OFF_CENTRE * pixels + 0.5).any():
            raise BadObservation(
                f"{image_key(camera)} has {size[0]} x {size[1]} pixels, but {CAMERA_INTRINSICS} of {camera} has its "
                f"principal point at row {matrices[0, 1, 2]:.4g}, column {matrices[0, 0, 2]:.4g}: scale both together"
            )
