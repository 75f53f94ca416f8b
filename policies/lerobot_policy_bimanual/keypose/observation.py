"""Convert a LeRobot batch to a point cloud, proprioception and instructions.

This runs inside the policy, on its device. Augmentation transforms the camera poses, which transforms the cloud.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.nn.functional import threshold

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.calibration import Calibration
from lerobot_bimanual.geometry.pinhole_torch import unproject

PROPRIO_PER_ARM = 4
"""Per arm: gripper open 0 or 1, two finger openings, time."""

FINGER_TRAVEL_M = 0.04
"""Travel of one Panda finger, which scales finger openings to 0..1. (PerAct2 code uses metres.)"""

OPEN_ABOVE = 0.9
"""Opening above which a gripper counts as open; with a held object it is below."""


@dataclass(frozen=True, eq=False)
class Observation:
    """One batch, in the world frame.

    Attributes:
        points: (b, 3, n) metres; NaN where a pixel has no depth.
        colours: (b, 3, n) RGB in [-1, 1].
        proprio: (b, 8), per arm, left first: gripper open, finger 1, finger 2 (0 to 1), time (+1 to -1).
        instructions: b sentences.
    """

    points: Tensor
    colours: Tensor
    proprio: Tensor
    instructions: list[str]


def with_calibration(batch: dict[str, Any], calibration: Calibration | None) -> dict[str, Any]:
    """A batch of a dataset's rows, completed with the calibration that holds for all rows, if there is one (docs/schema.md)."""
    if calibration is None or schema.CAMERA_INTRINSICS in batch or schema.WRIST_EXTRINSICS not in batch:
        return batch
    moving = batch[schema.WRIST_EXTRINSICS]
    room, intrinsics = (moving.new_tensor(vector).expand(len(moving), -1) for vector in calibration.vectors)
    extrinsics = torch.cat([room, moving], dim=-1)
    return batch | {schema.CAMERA_EXTRINSICS: extrinsics, schema.CAMERA_INTRINSICS: intrinsics}


def observe(
    batch: dict[str, Any],
    *,
    cameras: Sequence[str],
    keypose_horizon: int | None,
    motion: Tensor | None = None,
) -> Observation:
    """Read a batch.

    Args:
        batch: keys of `lerobot_bimanual.dataset.schema`: RGB float in [0, 1] (b, 3, h, w), depth in
            millimetres (b, 1, h, w), calibration of all five cameras, state, fingers, keypose step, `task`.
        cameras: cameras to use. Their image sizes may differ.
        keypose_horizon: keyposes over which the time feature falls from +1 to -1; None for no time, which is 0.
        motion: (b, 4, 4) world-frame motion of the whole scene, or None.
    """
    extrinsics = batch[schema.CAMERA_EXTRINSICS].float().unflatten(-1, (len(CAMERA_NAMES), 4, 4))
    intrinsics = batch[schema.CAMERA_INTRINSICS].float().unflatten(-1, (len(CAMERA_NAMES), 3, 3))
    poses = extrinsics if motion is None else motion[:, None] @ extrinsics
    points, colours = [], []
    for camera in cameras:
        index = CAMERA_NAMES.index(camera)
        depth_mm = threshold(batch[schema.depth_key(camera)][:, 0].float(), schema.UNMEASURED_MM, 0)
        points.append(unproject(depth_mm / schema.MM_PER_M, intrinsics[:, index], poses[:, index]))
        colours.append(batch[schema.image_key(camera)].float().flatten(2))
    return Observation(
        points=torch.cat(points, dim=2),
        colours=torch.cat(colours, dim=2) * 2 - 1,
        proprio=proprioception(batch, keypose_horizon),
        instructions=list(batch["task"]),
    )


def proprioception(batch: dict[str, Any], keypose_horizon: int | None) -> Tensor:
    """Proprioception (b, 8) as described in `Observation`.

    Time counts executed keyposes, in training and at inference, and stays at -1 after the horizon.
    """
    opening = batch[schema.STATE].float().unflatten(-1, (len(ARMS), -1))[..., -1:]  # (b, arms, 1)
    fingers = batch[schema.GRIPPER_FINGERS].float().unflatten(-1, (len(ARMS), -1))  # (b, arms, 2) m
    if keypose_horizon is None:
        time = torch.zeros_like(opening)
    else:
        # LeRobot's loader drops the last axis of (b, 1).
        step = batch[schema.KEYPOSE_STEP].float().reshape(-1, 1, 1)
        time = (1 - 2 * step / (keypose_horizon - 1)).clamp(min=-1).expand(-1, len(ARMS), -1)
    return torch.cat(
        [(opening > OPEN_ABOVE).float(), (fingers / FINGER_TRAVEL_M).clamp(0, 1), time], dim=-1
    ).flatten(1)
