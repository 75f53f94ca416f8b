"""Whether an observation can be true: complete, in its units, and of the cameras that its calibration describes.

A network answers anything with a keypose. So every observation is looked at before it is used: what cannot be true is
an error that says what was got and which flag mends it, what is only unlike the training is a warning, once.
"""

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.schema import (
    CAMERA_EXTRINSICS,
    CAMERA_INTRINSICS,
    DEPTH_MIN_M,
    GRIPPER_FINGERS,
    KEYPOSE_STEP,
    MM_PER_M,
    STATE,
    VECTORS,
    depth_key,
    image_key,
)
from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_policy_bimanual.errors import BadObservation
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig
from lerobot_policy_bimanual.keypose.observation_form import TASK, check_form

PLAUSIBLE_DEPTH_MM = 20.0
"""No scene is as near as this, and no depth in metres is as large."""

LEAST_STORED_MM = DEPTH_MIN_M * MM_PER_M
ROUNDING_MM = 1e-3
"""What datasets store where nothing was measured, exactly but for rounding."""

RGB_TOLERANCE = 0.01
"""That resampling may overshoot 0 and 1 by."""

DARK_RGB = 1.5 / 255
"""Images that are not brighter were divided by 255 twice, or the camera is off."""

OFF_CENTRE = 0.1
"""Of an image's side, that its principal point may lie beside its middle, twice as much from one edge to the other."""

LARGEST_FINGER_M = 0.5
LARGEST_OPENING = 1.5
"""Gripper openings are 0 to 1, and noise is allowed; percents are not."""

NO_ROTATION = 0.01
"""Largest deviation of R R^T from the identity."""

EVERY_POINT = 31
"""Of so many points one is looked at, to find whether any is inside."""

SHOWN_INSTRUCTIONS = 3

_log = logging.getLogger(__name__)


class ObservationCheck:
    """Looks at the observations of one policy, and keeps which warnings were given.

    Args:
        config: says which cameras the policy reads, of which size, and which instructions it was trained with.
    """

    def __init__(self, config: KeyposePolicyConfig):
        self._config = config
        self._warned: set[str] = set()

    def __call__(self, batch: Mapping[str, Any]) -> None:
        """Check a batch as `keypose.observation.observe` takes it; numbers travel from the device once.

        Raises:
            BadObservation: something is missing, of another form, or cannot be true.
        """
        check_form(batch, self._config)
        images, vectors = _measure(batch, self._config.cameras, self._config.vector_keys)
        self._check_depth(images)
        self._check_rgb(images)
        _check_proprioception(vectors)
        for camera in self._config.cameras:
            _check_calibration(camera, vectors, batch[image_key(camera)].shape[-2:])
        self._compare_with_training(batch)

    def look_at_points(self, points: Tensor, workspace: Workspace) -> None:
        """Warn if all cameras together see nothing where the hands can go.

        That alone is no error: a policy that has a wrist camera only may look past everything for a moment.

        Args:
            points: (b, 3, n) metres, NaN where there is no depth.
            workspace: where the hands can go.
        """
        lower, upper = points.new_tensor(workspace.lower), points.new_tensor(workspace.upper)
        some = points[..., ::EVERY_POINT]
        inside = ((some >= lower[:, None]) & (some < upper[:, None])).all(dim=1)
        if not inside.any(dim=1).all():
            self._warn(
                "nothing inside",
                "no camera sees anything inside the workspace, so that the policy acts blindly: are "
                f"{CAMERA_EXTRINSICS} world_T_camera in metres, and depth along the optical axis in millimetres?",
            )

    def _check_depth(self, images: NDArray[np.floating]) -> None:
        largest_mm = images[..., 1]  # (cameras, b)
        dead: NDArray[np.bool_] = (largest_mm <= 0) | (np.abs(largest_mm - LEAST_STORED_MM) < ROUNDING_MM)
        for camera, numbers in zip(self._config.cameras, images, strict=True):
            lowest, largest = float(numbers[:, 0].min()), float(numbers[:, 1].max())
            key = depth_key(camera)
            if lowest < 0:
                raise BadObservation(
                    f"{key} goes down to {lowest:.4g}, but depth is along the optical axis, in millimetres, and 0 or "
                    "NaN where there is none"
                )
            if 0 < largest < PLAUSIBLE_DEPTH_MM and abs(largest - LEAST_STORED_MM) >= ROUNDING_MM:
                raise BadObservation(
                    f"{key} has a maximum of {largest:.3g}, but depth must be in millimetres. LeRobot's datasets give "
                    "metres with --dataset.depth_output_unit=m: leave it out"
                )
        if dead.all(axis=0).any():
            raise BadObservation(
                f"no camera has any depth (all zero, NaN or infinite): {', '.join(self._config.cameras)}. A policy "
                "that sees nothing must not act"
            )
        # The cloud is made of all cameras, and real ones drop images; so one that sees nothing stops nobody.
        for camera, is_dead in zip(self._config.cameras, dead, strict=True):
            if is_dead.any():
                self._warn(
                    f"dead {camera}",
                    f"{depth_key(camera)} has no depth at all (zero, NaN or infinite): is it on?",
                )

    def _check_rgb(self, images: NDArray[np.floating]) -> None:
        for camera, numbers in zip(self._config.cameras, images, strict=True):
            lowest, largest = float(numbers[:, 2].min()), float(numbers[:, 3].max())
            key = image_key(camera)
            if not (lowest >= -RGB_TOLERANCE and largest <= 1 + RGB_TOLERANCE):
                raise BadObservation(
                    f"{key} goes from {lowest:.4g} to {largest:.4g}, but RGB must be from 0 to 1: divide 0..255 by 255 "
                    "once, and leave normalisation to the policy"
                )
            if largest < DARK_RGB:
                self._warn(
                    f"dark {camera}",
                    f"{key} is black (nothing above {largest:.2g}): is the camera on, or was it divided by 255 twice?",
                )

    def _compare_with_training(self, batch: Mapping[str, Any]) -> None:
        trained = self._config.input_features or {}
        for camera in self._config.cameras:
            feature = trained.get(image_key(camera))
            size = tuple(batch[image_key(camera)].shape[-2:])
            if feature is not None and tuple(feature.shape[-2:]) != size:
                height, width = feature.shape[-2:]
                flag = height if height == width else f"{height}x{width}"
                self._warn(
                    "size",
                    f"this policy was trained with images of {height} x {width} pixels, but {camera} has "
                    f"{size[0]} x {size[1]}; it may fail for that alone. lerobot-eval gives the size of the training "
                    f"with --env.image_size={flag}",
                )
        known = self._config.trained_instructions
        if known and (unknown := [text for text in batch[TASK] if text not in known]):
            shown = ", ".join(map(repr, known[:SHOWN_INSTRUCTIONS]))
            more = f" and {len(known) - SHOWN_INSTRUCTIONS} more" if len(known) > SHOWN_INSTRUCTIONS else ""
            self._warn(
                "task",
                f"this policy was never trained to {unknown[0]!r}, but with {shown}{more}: is it another task "
                "(--env.task)?",
            )

    def _warn(self, what: str, message: str) -> None:
        if what not in self._warned:
            self._warned.add(what)
            _log.warning(message)


def _measure(
    batch: Mapping[str, Any], cameras: tuple[str, ...], keys: tuple[str, ...]
) -> tuple[NDArray[np.floating], dict[str, NDArray[np.floating]]]:
    """What is judged, brought from the device in one go.

    Returns:
        (cameras, b, 4) lowest and largest depth, without pixels that have none, and lowest and largest colour of every
        sample; and the vectors (b, n) by key.
    """
    samples = len(batch[TASK])
    numbers = []
    for camera in cameras:
        depth = batch[depth_key(camera)].float().flatten(1).nan_to_num(nan=0, posinf=0)
        colours = batch[image_key(camera)].float().flatten(1)
        # On a CPU amin and amax are many times faster than aminmax.
        numbers.append(torch.stack([depth.amin(1), depth.amax(1), colours.amin(1), colours.amax(1)], dim=1))
    images = torch.stack(numbers)
    vectors = torch.cat([batch[key].float().reshape(samples, -1) for key in keys], dim=1)
    on_host = torch.cat([images.flatten(), vectors.flatten()]).detach().cpu().numpy()
    parts = np.split(
        on_host[images.numel() :].reshape(samples, -1),
        np.cumsum([len(VECTORS[key]) for key in keys])[:-1],
        axis=1,
    )
    return on_host[: images.numel()].reshape(images.shape), dict(zip(keys, parts, strict=True))


def _check_proprioception(vectors: Mapping[str, NDArray[np.floating]]) -> None:
    for key in (key for key in (STATE, GRIPPER_FINGERS, KEYPOSE_STEP) if key in vectors):
        if not np.isfinite(vectors[key]).all():
            raise BadObservation(f"{key} holds {_first_not_finite(vectors[key])}, but must hold numbers")
    openings = vectors[STATE].reshape(len(vectors[STATE]), len(ARMS), -1)[..., -1]
    for key, values, largest, unit in (
        (f"the gripper opening in {STATE}", openings, LARGEST_OPENING, "from 0 (closed) to 1 (open)"),
        (GRIPPER_FINGERS, vectors[GRIPPER_FINGERS], LARGEST_FINGER_M, "in metres"),
    ):
        furthest = float(values.flat[np.abs(values).argmax()])
        if abs(furthest) > largest:
            raise BadObservation(f"{key} is {furthest:.4g}, but must be {unit}")
    if KEYPOSE_STEP in vectors and (lowest := float(vectors[KEYPOSE_STEP].min())) < 0:
        raise BadObservation(
            f"{KEYPOSE_STEP} is {lowest:.4g}, but counts the keyposes executed so far, from 0"
        )


def _check_calibration(
    camera: str, vectors: Mapping[str, NDArray[np.floating]], size: tuple[int, int]
) -> None:
    index = CAMERA_NAMES.index(camera)
    for key, sides in ((CAMERA_EXTRINSICS, 4), (CAMERA_INTRINSICS, 3)):
        matrices = vectors[key].reshape(-1, len(CAMERA_NAMES), sides, sides)[:, index]
        if not np.isfinite(matrices).all():
            raise BadObservation(
                f"{key} of {camera} holds {_first_not_finite(matrices)}, but must hold numbers"
            )
        if key == CAMERA_EXTRINSICS:
            _check_poses(camera, matrices)
        else:
            _check_pinholes(camera, matrices, size)


def _check_poses(camera: str, poses: NDArray[np.floating]) -> None:
    rotation = poses[:, :3, :3].astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max()
        mirrored = np.linalg.det(rotation).min() < 0
    if not deviation <= NO_ROTATION or mirrored or np.abs(poses[:, 3] - (0, 0, 0, 1)).max() > NO_ROTATION:
        raise BadObservation(
            f"{CAMERA_EXTRINSICS} of {camera} is no pose: it must be a row-major 4 x 4 world_T_camera with a rotation, "
            f"a shift in metres and the last row 0 0 0 1, but has {poses[0].round(3).tolist()}"
        )


def _check_pinholes(camera: str, intrinsics: NDArray[np.floating], size: tuple[int, int]) -> None:
    if intrinsics[:, [0, 1], [0, 1]].min() <= 0:
        raise BadObservation(
            f"{CAMERA_INTRINSICS} of {camera} has the focal lengths {intrinsics[0, [0, 1], [0, 1]].tolist()}, but they "
            "must be above 0, in pixels"
        )
    for name, pixels, centre in (
        ("wide", size[1], intrinsics[:, 0, 2]),
        ("high", size[0], intrinsics[:, 1, 2]),
    ):
        worst = float(centre[np.abs(2 * centre - pixels).argmax()])
        if abs(2 * worst - pixels) > OFF_CENTRE * pixels + 1:
            raise BadObservation(
                f"{image_key(camera)} is {pixels} pixels {name}, but {CAMERA_INTRINSICS} of {camera} has its middle at "
                f"{worst:.4g}, as an image of {2 * worst:.4g} has: scale both together"
            )


def _first_not_finite(values: NDArray[np.floating]) -> float:
    return float(values[~np.isfinite(values)][0])
