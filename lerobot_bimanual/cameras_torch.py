"""Batched unprojection on torch tensors; conventions of `cameras`."""

import torch
from torch import Tensor


def unproject(depth_m: Tensor, intrinsics: Tensor, world_T_camera: Tensor) -> Tensor:
    """World points of depth images.

    Args:
        depth_m: (..., h, w) metres along the optical axis; 0, negative or non-finite where invalid.
        intrinsics: (..., 3, 3) pinhole matrices in pixels.
        world_T_camera: (..., 4, 4), OpenCV axes.

    Returns:
        (..., h, w, 3) metres in the world frame, NaN where the depth is invalid.
    """
    height, width = depth_m.shape[-2:]
    options = {"dtype": depth_m.dtype, "device": depth_m.device}
    focal_x, focal_y = intrinsics[..., 0, 0, None], intrinsics[..., 1, 1, None]
    ray_x = (torch.arange(width, **options) + 0.5 - intrinsics[..., 0, 2, None]) / focal_x  # (..., w)
    ray_y = (torch.arange(height, **options) + 0.5 - intrinsics[..., 1, 2, None]) / focal_y  # (..., h)
    valid = torch.isfinite(depth_m) & (depth_m > 0)
    depth = torch.where(valid, depth_m, torch.full_like(depth_m, torch.nan))
    camera_points = torch.stack([depth * ray_x[..., None, :], depth * ray_y[..., :, None], depth], dim=-1)
    rotation, translation = world_T_camera[..., :3, :3], world_T_camera[..., :3, 3]
    return torch.einsum("...hwj,...ij->...hwi", camera_points, rotation) + translation[..., None, None, :]
