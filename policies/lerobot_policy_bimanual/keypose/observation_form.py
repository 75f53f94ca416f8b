"""The form of an observation: nothing missing, every tensor of the right shape, one instruction per sample.

Only shapes and types are looked at, so that nothing is fetched from the device.
"""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from lerobot_bimanual.dataset.schema import (
    VECTORS,
    depth_key,
    image_key,
)
from lerobot_policy_bimanual.errors import BadObservation
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig

TASK = "task"


def check_form(batch: Mapping[str, Any], config: KeyposePolicyConfig) -> None:
    """Check that a batch has what a policy of this config reads, in the form of `keypose.observation.observe`.

    Raises:
        BadObservation: something is missing, no tensor, or of another shape or kind of number.
    """
    _check_keys(batch, config)
    samples = _check_instructions(batch[TASK])
    for camera in config.cameras:
        _check_images(batch, camera, samples)
    for key in config.vector_keys:
        _check_vector(key, batch[key], samples)


def _check_keys(batch: Mapping[str, Any], config: KeyposePolicyConfig) -> None:
    missing = [key for key in (*config.observation_keys, TASK) if key not in batch]
    if not missing:
        return
    hints = []
    images = [key for key in missing if key.startswith("observation.images.")]
    if images:
        cameras = ",".join(config.cameras)
        hints.append(f"lerobot-eval gives it with --env.obs=rgbd --env.cameras={cameras}")
    if TASK in missing:
        hints.append("`task` is a list of one instruction per sample, --task=... of LeRobot's rollout")
    if missing != [TASK]:
        hints.append("what has another name is renamed with --rename_map")
    got = ", ".join(sorted(str(key) for key in batch if str(key).startswith("observation.")))
    raise BadObservation(
        f"the observation lacks {', '.join(missing)}, which the policy reads: {'; '.join(hints)}. "
        f"It has {got or 'no observation at all'}"
    )


def _check_instructions(instructions: Any) -> int:
    """The number of samples in the batch, which is that of the instructions."""
    if (
        not isinstance(instructions, list | tuple)
        or not instructions
        or not all(isinstance(text, str) and text.strip() for text in instructions)
    ):
        raise BadObservation(
            f"`task` is {_short(instructions)}, but must be a list of one instruction in words per sample, as in "
            "['lift the ball']"
        )
    return len(instructions)


def _check_images(batch: Mapping[str, Any], camera: str, samples: int) -> None:
    rgb, depth = batch[image_key(camera)], batch[depth_key(camera)]
    for key, image, channels in ((image_key(camera), rgb, 3), (depth_key(camera), depth, 1)):
        _check_tensor(key, image)
        if image.ndim != 4 or image.shape[:2] != (samples, channels) or not image.numel():
            raise BadObservation(
                f"{key} has the shape {tuple(image.shape)}, but must have ({samples}, {channels}, height, width): "
                f"`task` names {samples}"
            )
    if not rgb.is_floating_point():
        raise BadObservation(
            f"{image_key(camera)} holds {rgb.dtype}, but RGB must be floats from 0 to 1: divide by 255"
        )
    if rgb.shape[-2:] != depth.shape[-2:]:
        raise BadObservation(
            f"{image_key(camera)} has {_size(rgb)} pixels and its depth {_size(depth)}, but every pixel needs both: "
            "align depth to colour"
        )


def _check_vector(key: str, vector: Any, samples: int) -> None:
    _check_tensor(key, vector)
    length = len(VECTORS[key])
    # LeRobot's loader drops the last axis of what is one number per sample.
    if vector.shape != (samples, length) and not (length == 1 and vector.shape == (samples,)):
        raise BadObservation(
            f"{key} has the shape {tuple(vector.shape)}, but must have ({samples}, {length}): `task` names {samples}"
        )


def _check_tensor(key: str, value: Any) -> None:
    if not isinstance(value, Tensor):
        raise BadObservation(f"{key} is a {type(value).__name__}, but must be a tensor")
    if value.is_complex() or value.dtype == torch.bool or value.is_quantized or value.layout != torch.strided:
        raise BadObservation(f"{key} holds {value.dtype} ({value.layout}), but must hold plain numbers")


def _size(image: Tensor) -> str:
    return f"{image.shape[-2]} x {image.shape[-1]}"


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:80] + "..."
