"""What a policy saw in one sample, what it predicted and what would have been right, as plain arrays."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset.schema import KEYPOSE_STEP, NEXT_KEYPOSE
from lerobot_bimanual.geometry.rotations import rotation_angle_rad
from lerobot_bimanual.keypose import BimanualKeypose, Keypose
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.peract.voxel_grid import voxelise

SHOWN_VOXELS = 100
"""Voxels per axis that the scene is shown with, at most."""

HOT_VOXELS = 300
"""Voxels of an arm's heat map that are shown, at most."""

COLDEST = 0.02
"""Voxels below this share of the most probable one are not shown."""


@dataclass(frozen=True, eq=False)
class Voxels:
    """Equal cubes on a lattice.

    Attributes:
        index: (n, 3) int64, place on the lattice.
        center_m: (n, 3) in the world frame.
        size_m: (3,) edge lengths.
    """

    index: NDArray[np.int64]
    center_m: NDArray[np.float64]
    size_m: NDArray[np.float64]

    def __len__(self) -> int:
        """Number of cubes."""
        return len(self.index)


@dataclass(frozen=True, eq=False)
class ArmInspection:
    """One arm's prediction and truth.

    Attributes:
        arm: whose.
        predicted: the chosen keypose.
        true: the label.
        hot: the most probable voxels, the coldest first.
        heat: (n,) their probabilities.
        true_voxel_probability: 0 if the label lies outside the workspace.
        rotation_probabilities: of the chosen bin of each Euler axis.
        gripper_probability: of the chosen state of the gripper.
        collision_probability: of the chosen collision flag.
    """

    arm: Arm
    predicted: Keypose
    true: Keypose
    hot: Voxels
    heat: NDArray[np.float64]
    true_voxel_probability: float
    rotation_probabilities: tuple[float, float, float]
    gripper_probability: float
    collision_probability: float

    @property
    def position_error_cm(self) -> float:
        """Distance of the predicted hand from the true one."""
        return 100 * float(np.linalg.norm(self.predicted.pose.position - self.true.pose.position))

    @property
    def rotation_error_deg(self) -> float:
        """Angle between the predicted hand and the true one."""
        angle_rad = rotation_angle_rad(self.predicted.pose.quat_wxyz, self.true.pose.quat_wxyz)
        return float(np.rad2deg(angle_rad))


@dataclass(frozen=True, eq=False)
class Inspection:
    """One sample.

    Attributes:
        instruction: the sentence.
        keypose_step: keyposes executed before.
        scene: occupied voxels of the workspace.
        rgb: (n, 3) uint8, their colours.
        arms: left first.
    """

    instruction: str
    keypose_step: int
    scene: Voxels
    rgb: NDArray[np.uint8]
    arms: tuple[ArmInspection, ...]


def look(policy: KeyposePolicy, batch: dict[str, Any]) -> Inspection:
    """Run a policy on the first sample of a preprocessed batch with label.

    Raises:
        BadObservation: the batch cannot be true.
    """
    observation, prediction, chosen = policy.infer(batch)
    workspace, codec = policy.config.workspace, policy.codec
    grid = voxelise(
        observation.points[:1],
        observation.colours[:1],
        workspace=workspace,
        voxels=min(policy.config.voxel_size, SHOWN_VOXELS),
    )[0]
    occupied = grid[9].nonzero()
    colours = grid[3:6, *occupied.unbind(1)].T
    true_bins = codec.encode(batch[NEXT_KEYPOSE][:1].float())
    chosen_bins = prediction.best()
    true = BimanualKeypose.from_vector(batch[NEXT_KEYPOSE][0].cpu())
    predicted = BimanualKeypose.from_vector(chosen[0].cpu())
    probabilities = prediction.translation.probabilities()[0].float()
    arms = []
    for arm in ARMS:
        index, volume = arm.ordinal, probabilities[arm.ordinal]
        hot, heat = _hottest(volume, codec.voxel_centers, codec.bins.voxel_size_m)
        x, y, z = true_bins.voxel[0, index].tolist()
        within = all(0 <= place < codec.bins.voxels for place in (x, y, z))
        rotation = _of_class(prediction.rotation[0, index], chosen_bins.rotation[0, index]).tolist()
        gripper = _of_class(prediction.gripper_open[0, index], chosen_bins.gripper_open[0, index])
        collisions = _of_class(
            prediction.ignore_collisions[0, index], chosen_bins.ignore_collisions[0, index]
        )
        arms.append(
            ArmInspection(
                arm=arm,
                predicted=predicted[arm],
                true=true[arm],
                hot=hot,
                heat=heat,
                true_voxel_probability=float(volume[x, y, z]) if within else 0.0,
                rotation_probabilities=tuple(rotation),
                gripper_probability=float(gripper),
                collision_probability=float(collisions),
            )
        )
    size_m = workspace.size / grid.shape[-1]
    index = occupied.cpu().numpy()
    return Inspection(
        instruction=observation.instructions[0],
        keypose_step=int(batch[KEYPOSE_STEP].flatten()[0]),
        scene=Voxels(index, workspace.lower + (index + 0.5) * size_m, size_m),
        rgb=(127.5 * (colours + 1)).round().clamp(0, 255).byte().cpu().numpy(),
        arms=tuple(arms),
    )


def _hottest(volume: Tensor, voxel_centers: Any, size_m: NDArray[np.float64]) -> tuple[Voxels, NDArray]:
    """The most probable voxels of a heat map (v, v, v), the coldest first."""
    heat, flat = volume.flatten().topk(min(HOT_VOXELS, volume.numel()))
    kept = heat >= COLDEST * heat[0]
    heat, flat = heat[kept].flip(0), flat[kept].flip(0)
    voxel = torch.stack(torch.unravel_index(flat, volume.shape), dim=1)
    center_m = voxel_centers(voxel).double().cpu().numpy()
    return Voxels(voxel.cpu().numpy(), center_m, np.asarray(size_m)), heat.double().cpu().numpy()


def _of_class(logits: Tensor, chosen: Tensor) -> Tensor:
    """Probability (...) of the chosen class of logits (..., classes)."""
    return logits.float().softmax(dim=-1).gather(-1, chosen[..., None])[..., 0]
