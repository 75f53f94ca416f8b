"""Random rigid transforms of the whole scene, cloud and both keyposes.

One world-frame transform for both arms is the correct form. PerAct2's reference rotates the cloud about the right gripper
but only shifts the left label, and stops retrying as soon as one arm is inside.
"""

import math

import torch
import torch.distributed as dist
from torch import Tensor

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.rotations_torch import (
    matrix_to_quat_wxyz,
    quat_wxyz_canonical,
    quat_wxyz_multiply,
)
from lerobot_bimanual.keypose_layout import ARM_KEYPOSE_DIM, POSITION, QUATERNION
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig

MAX_DRAWS = 100
"""Draws per sample before the identity is used (as in PerAct2 code)."""


def sample_motions(keyposes: Tensor, config: KeyposePolicyConfig) -> Tensor:
    """Draw one motion of the scene per sample, repeated until both keyposes stay inside the workspace.

    A motion is a yaw about the vertical axis through the workspace's centre, uniform over the multiples of
    `augmentation_yaw_step_deg` so that rotation bins stay exact, then a uniform shift.

    Args:
        keyposes: (b, 18) flat keyposes.
        config: its workspace, `augmentation_shift_m`, `augmentation_yaw_deg` and `augmentation_yaw_step_deg`.

    Returns:
        (b, 4, 4) world-frame transforms; the identity where every draw left the workspace.
    """
    samples = len(keyposes)
    options = {"dtype": keyposes.dtype, "device": keyposes.device}
    drawn = {"device": keyposes.device, "generator": _generator(keyposes.device)}
    steps = int(config.augmentation_yaw_deg / config.augmentation_yaw_step_deg + 1e-6)
    yaw_steps = torch.randint(-steps, steps + 1, (MAX_DRAWS, samples), **drawn)
    yaw = yaw_steps * math.radians(config.augmentation_yaw_step_deg)
    shift = torch.rand(MAX_DRAWS, samples, 3, dtype=keyposes.dtype, **drawn) * 2 - 1
    shift = shift * torch.tensor(config.augmentation_shift_m, **options)
    center = torch.tensor(config.workspace.center, **options)
    draws = _transforms(yaw.to(keyposes.dtype), shift, center)  # (draws, b, 4, 4)
    positions = _arms(keyposes)[..., POSITION]  # (b, arms, 3)
    moved = _apply(draws[:, :, None], positions)  # (draws, b, arms, 3)
    lower = torch.tensor(config.workspace.lower, **options)
    upper = torch.tensor(config.workspace.upper, **options)
    inside = ((moved >= lower) & (moved < upper)).flatten(2).all(dim=-1)  # (draws, b)
    first = inside.int().argmax(dim=0)
    chosen = draws[first, torch.arange(samples, device=keyposes.device)]
    return torch.where(inside.any(dim=0)[:, None, None], chosen, torch.eye(4, **options))


def _transforms(yaw: Tensor, shift: Tensor, center: Tensor) -> Tensor:
    """Transforms (..., 4, 4): yaws (...) about a vertical axis through (3,), then shifts (..., 3)."""
    cosine, sine, zero, one = yaw.cos(), yaw.sin(), torch.zeros_like(yaw), torch.ones_like(yaw)
    rotation = torch.stack([cosine, -sine, zero, sine, cosine, zero, zero, zero, one], dim=-1)
    rotation = rotation.unflatten(-1, (3, 3))
    transform = torch.eye(4, dtype=yaw.dtype, device=yaw.device).repeat(*yaw.shape, 1, 1)
    transform[..., :3, :3] = rotation
    transform[..., :3, 3] = center - rotation @ center + shift
    return transform


def move_keyposes(transform: Tensor, keyposes: Tensor) -> Tensor:
    """Both arms' keyposes (b, 18) after world-frame transforms (b, 4, 4); flags stay."""
    arms = _arms(keyposes).clone()
    turn = matrix_to_quat_wxyz(transform[:, :3, :3])[:, None]
    arms[..., POSITION] = _apply(transform[:, None], arms[..., POSITION])
    arms[..., QUATERNION] = quat_wxyz_canonical(quat_wxyz_multiply(turn, arms[..., QUATERNION]))
    return arms.flatten(1)


def _generator(device: torch.device) -> torch.Generator | None:
    """None, the global generator; one per process in distributed training, because LeRobot seeds all processes alike."""
    if not (dist.is_available() and dist.is_initialized() and dist.get_world_size() > 1):
        return None
    # Drawn from the global generator each time, so that a resumed training continues exactly.
    shared = int(torch.randint(2**62, ()))
    return torch.Generator(device).manual_seed(shared + dist.get_rank())


def _arms(keyposes: Tensor) -> Tensor:
    return keyposes.unflatten(-1, (len(ARMS), ARM_KEYPOSE_DIM))


def _apply(transform: Tensor, points: Tensor) -> Tensor:
    """Transforms (..., 4, 4) of points (..., 3), broadcast."""
    return (transform[..., :3, :3] @ points[..., None])[..., 0] + transform[..., :3, 3]
