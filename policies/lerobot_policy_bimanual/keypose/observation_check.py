"""Check that an observation is complete, in the units of the schema, and not empty.

A network predicts a keypose from any input. So an impossible input is an error, which names the flag that corrects it; an
input that only differs from those in training is a warning, given once.
"""

import logging
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from lerobot_bimanual.dataset.schema import DEPTH_MIN_M, MM_PER_M, VECTORS, depth_key, image_key
from lerobot_policy_bimanual.errors import BadObservation
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig

MIN_PLAUSIBLE_DEPTH_MM = 20.0
"""No scene is as near as this, and no depth in metres is as large."""

ROUNDING_MM = 1e-3
"""Datasets store `DEPTH_MIN_M`, up to this, where nothing was measured."""

RGB_TOLERANCE = 0.01
"""Overshoot beyond 0 and 1 that resampling may cause."""

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
            BadObservation: something is missing, of another shape or unit, or no camera has any depth.
        """
        _check_shapes(batch, self._config)
        extremes = [_extremes(batch[depth_key(c)], batch[image_key(c)]) for c in self._config.cameras]
        # (cameras, b) each
        nearest_mm, farthest_mm, darkest, brightest = torch.stack(extremes, dim=1).cpu().unbind(0)
        is_empty = (farthest_mm <= 0) | ((farthest_mm - DEPTH_MIN_M * MM_PER_M).abs() < ROUNDING_MM)
        for index, camera in enumerate(self._config.cameras):
            low, high = float(nearest_mm[index].min()), float(farthest_mm[index].max())
            if low < 0 or (high < MIN_PLAUSIBLE_DEPTH_MM and not is_empty[index].all()):
                raise BadObservation(
                    f"{depth_key(camera)} goes from {low:.4g} to {high:.4g}, but depth must be in millimetres along the "
                    "optical axis. LeRobot's datasets give metres with --dataset.depth_output_unit=m: leave it out"
                )
            low, high = float(darkest[index].min()), float(brightest[index].max())
            if not (low >= -RGB_TOLERANCE and high <= 1 + RGB_TOLERANCE):
                raise BadObservation(
                    f"{image_key(camera)} goes from {low:.4g} to {high:.4g}, but RGB must be from 0 to 1: divide 0..255 "
                    "by 255 once, and leave normalisation to the policy"
                )
            if is_empty[index].any():  # real cameras drop images, and the cloud is made of all cameras
                self._warn(
                    camera, f"{depth_key(camera)} has no depth at all (zero, NaN or infinite): is it on?"
                )
        if is_empty.all(dim=0).any():
            raise BadObservation(
                f"no camera has any depth (all zero, NaN or infinite): {', '.join(self._config.cameras)}. A policy "
                "that sees nothing must not act"
            )
        self._compare_with_training(batch)

    def _compare_with_training(self, batch: Mapping[str, Any]) -> None:
        for camera in self._config.cameras:
            feature = (self._config.input_features or {}).get(image_key(camera))
            size = tuple(batch[image_key(camera)].shape[-2:])
            if feature is not None and (trained := tuple(feature.shape[-2:])) != size:
                self._warn(
                    "size",
                    f"this policy was trained with images of {trained[0]} x {trained[1]} pixels, but {camera} has "
                    f"{size[0]} x {size[1]}. lerobot-eval gives the size of the training with "
                    f"--env.image_size={trained[0]}x{trained[1]}",
                )
                break
        known = self._config.trained_instructions
        if known and (unknown := [text for text in batch["task"] if text not in known]):
            shown = ", ".join(map(repr, known[:3])) + (", ..." if len(known) > 3 else "")
            self._warn(
                "task",
                f"this policy was never trained with the instruction {unknown[0]!r}, but with {shown}: is this the wrong task "
                "(--env.task)?",
            )

    def _warn(self, kind: str, message: str) -> None:
        if kind not in self._warned:
            self._warned.add(kind)
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
    samples = len(batch["task"])
    shapes = {key: (samples, len(VECTORS[key])) for key in config.vector_keys}
    for camera in config.cameras:
        pixels = tuple(batch[image_key(camera)].shape[-2:])
        shapes |= {image_key(camera): (samples, 3, *pixels), depth_key(camera): (samples, 1, *pixels)}
    for key, shape in shapes.items():
        found = tuple(batch[key].shape)
        # LeRobot's loader drops the last axis of what is one number per sample.
        if shape not in (found, (*found, 1)) or 0 in shape:
            raise BadObservation(
                f"{key} has the shape {found}, but must have the shape {shape}, as `task` holds {samples} instructions; "
                "depth must be aligned to colour"
            )


def _extremes(depth_mm: Tensor, rgb: Tensor) -> Tensor:
    """Smallest and largest depth and colour (4, b) of every sample, without pixels that have no depth."""
    depth_mm, rgb = depth_mm.float().flatten(1).nan_to_num(nan=0, posinf=0), rgb.float().flatten(1)
    # On a CPU amin and amax are many times faster than aminmax.
    return torch.stack([depth_mm.amin(1), depth_mm.amax(1), rgb.amin(1), rgb.amax(1)])
