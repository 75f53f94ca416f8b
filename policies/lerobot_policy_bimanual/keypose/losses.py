"""Training loss and prediction errors of keypose policies."""

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_bimanual.geometry.rotations_torch import rotation_angle_rad
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, POSITION, QUATERNION
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction

FAR_M = 0.05
"""Position error from which a prediction counts as a miss."""


def keypose_losses(prediction: KeyposePrediction, target: KeyposeBins) -> dict[str, Tensor]:
    """Cross-entropies (b,) of all parts, each summed over arms and rotation axes.

    The training loss is their plain sum, averaged over the batch (PerAct2 paper and code: all weights are 1).
    """
    offset = target.voxel_position - target.voxel
    return {
        "translation": prediction.translation.cross_entropy(target.voxel, offset).sum(dim=1),
        "rotation": _cross_entropy(prediction.rotation, target.rotation),
        "gripper_open": _cross_entropy(prediction.gripper_open, target.gripper_open),
        "ignore_collisions": _cross_entropy(prediction.ignore_collisions, target.ignore_collisions),
    }


def _cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """Sum over all dimensions of target (b, ...) but the first."""
    losses = F.cross_entropy(logits.flatten(0, -2), target.flatten(), reduction="none")
    return losses.view_as(target).flatten(1).sum(dim=1)


@torch.no_grad()
def keypose_errors(predicted: Tensor, keyposes: Tensor) -> dict[str, Tensor]:
    """Distances between predicted and true flat keyposes (b, 18), averaged over the batch, per arm.

    Returns:
        `<arm>_position_cm`, `<arm>_rotation_deg`, and `<arm>_far`, the share beyond `FAR_M`.
    """
    distance_m, angle_rad = distances(predicted, keyposes)
    errors = {}
    for arm in ARMS:
        errors[f"{arm}_position_cm"] = 100 * distance_m[:, arm.ordinal].mean()
        errors[f"{arm}_rotation_deg"] = torch.rad2deg(angle_rad[:, arm.ordinal]).mean()
        errors[f"{arm}_far"] = (distance_m[:, arm.ordinal] > FAR_M).float().mean()
    return errors


def distances(predicted: Tensor, keyposes: Tensor) -> tuple[Tensor, Tensor]:
    """Distances in metres and angles in radians, (b, arms) each, between flat keyposes (b, 18)."""
    shape = (len(ARMS), ARM_KEYPOSE_DIM)
    predicted, keyposes = predicted.unflatten(-1, shape), keyposes.unflatten(-1, shape)
    return (
        (predicted[..., POSITION] - keyposes[..., POSITION]).norm(dim=-1),
        rotation_angle_rad(predicted[..., QUATERNION], keyposes[..., QUATERNION]),
    )
