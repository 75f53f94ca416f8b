"""What a policy saw in one sample, what it predicted, and the label, as plain arrays."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.dataset.schema import KEYPOSE_STEP, NEXT_KEYPOSE
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_policy_bimanual.keypose.losses import distances
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.nn.prediction import KeyposePrediction
from lerobot_policy_bimanual.peract.voxel_grid import voxelise

MAX_SCENE_VOXELS = 100
"""Largest number of voxels per axis that the scene is shown with."""

MAX_HOT_VOXELS = 300
"""Largest number of voxels of an arm's heat map that are shown."""

MIN_HEAT_SHARE = 0.02
"""Voxels with less than this share of the highest probability are not shown."""


@dataclass(frozen=True, eq=False)
class ArmInspection:
    """Prediction and label of one arm.

    Attributes:
        arm: the arm.
        predicted: the chosen keypose.
        true: the label.
        hot_m: (n, 3) centres of the most probable voxels in the world frame, the most probable last.
        heat: (n,) their probabilities.
        numbers: errors and probabilities, in one line.
    """

    arm: Arm
    predicted: Keypose
    true: Keypose
    hot_m: NDArray[np.float64]
    heat: NDArray[np.float64]
    numbers: str


@dataclass(frozen=True, eq=False)
class Inspection:
    """One sample.

    Attributes:
        instruction: the sentence.
        keypose_step: number of keyposes executed before.
        scene_m: (n, 3) centres of the occupied voxels of the workspace in the world frame.
        rgb: (n, 3) uint8, their colours.
        arms: left first.
    """

    instruction: str
    keypose_step: int
    scene_m: NDArray[np.float64]
    rgb: NDArray[np.uint8]
    arms: tuple[ArmInspection, ...]


def inspect_sample(policy: KeyposePolicy, batch: dict[str, Any]) -> Inspection:
    """Run a policy on the first sample of a preprocessed batch with label.

    Raises:
        BadObservation: the batch cannot be true.
    """
    observation, prediction, chosen = policy.infer(batch)
    workspace, voxels = policy.config.workspace, min(policy.config.voxel_size, MAX_SCENE_VOXELS)
    points, colours = observation.points[:1], observation.colours[:1]
    grid = voxelise(points, colours, workspace=workspace, voxels=voxels)[0]
    index = grid[9].nonzero().cpu().numpy()
    rgb = grid[3:6, *grid[9].nonzero().unbind(1)].T
    return Inspection(
        instruction=observation.instructions[0],
        keypose_step=int(batch[KEYPOSE_STEP].flatten()[0]),
        scene_m=workspace.lower + (index + 0.5) * workspace.size / voxels,
        rgb=(127.5 * (rgb + 1)).round().clamp(0, 255).byte().cpu().numpy(),
        arms=_inspect_arms(prediction, policy.codec, chosen, batch[NEXT_KEYPOSE]),
    )


def _inspect_arms(
    prediction: KeyposePrediction, codec: TorchKeyposeCodec, chosen: torch.Tensor, label: torch.Tensor
) -> tuple[ArmInspection, ...]:
    predicted, true = (BimanualKeypose.from_vector(vectors[0].cpu()) for vectors in (chosen, label))
    distance_m, angle_rad = (errors[0].tolist() for errors in distances(chosen[:1], label[:1].float()))
    true_voxel = codec.encode(label[:1].float()).voxel[0]
    volumes = prediction.translation.probabilities()[0].float()
    # A chosen class is the most probable one.
    rotation, gripper, collisions = (
        logits[0].float().softmax(dim=-1).amax(dim=-1).tolist()
        for logits in (prediction.rotation, prediction.gripper_open, prediction.ignore_collisions)
    )

    def verdict(right: bool, probability: float) -> str:
        return f"{'right' if right else 'wrong'} ({probability:.0%})"

    arms = []
    for arm, volume in zip(ARMS, volumes, strict=True):
        heat, flat = volume.flatten().topk(min(MAX_HOT_VOXELS, volume.numel()))
        kept = heat >= MIN_HEAT_SHARE * heat[0]
        voxel = torch.stack(torch.unravel_index(flat[kept].flip(0), volume.shape), dim=1)
        place = true_voxel[arm.ordinal]
        within = bool(((place >= 0) & (place < codec.voxels)).all())
        at_true = float(volume[tuple(place)]) if within else 0.0
        one, other, index = predicted[arm], true[arm], arm.ordinal
        numbers = (
            f"{arm} arm: {100 * distance_m[index]:.1f} cm off, best voxel {heat[0]:.1%}, true voxel {at_true:.1%}; "
            f"{math.degrees(angle_rad[index]):.0f}° off, angles x / y / z {' / '.join(f'{p:.0%}' for p in rotation[index])}; "
            f"gripper {verdict(one.gripper_open == other.gripper_open, gripper[index])}, collision flag "
            f"{verdict(one.ignore_collisions == other.ignore_collisions, collisions[index])}"
        )
        hot_m = codec.voxel_centers(voxel).double().cpu().numpy()
        arms.append(ArmInspection(arm, one, other, hot_m, heat[kept].flip(0).double().cpu().numpy(), numbers))
    return tuple(arms)
