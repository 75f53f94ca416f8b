"""Point clouds to voxel grids."""

import torch
from torch import Tensor

from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_policy_bimanual.nn.layers import gaussian_1d

GRID_CHANNELS = 10
"""Mean xyz [m], mean RGB in [-1, 1], voxel index / voxels, occupancy 0 or 1 (PerAct2 code)."""

QUADRATIC = slice(3, 9)
"""Channels whose squares are the quadratic features: colours and voxel indices."""

CELLS_BEHIND = 4096
"""Number of cells behind the grid that receive the points outside the workspace."""


def voxelise(points: Tensor, colours: Tensor, *, workspace: Workspace, voxels: int) -> Tensor:
    """Average the points of every voxel.

    Points outside the workspace are ignored, NaN included.

    Args:
        points: (b, 3, n) world positions in metres.
        colours: (b, 3, n) RGB in [-1, 1].
        workspace: the box that the grid fills.
        voxels: voxels per axis.

    Returns:
        (b, 10, voxels, voxels, voxels) float32, channels as in `GRID_CHANNELS`, last in
        memory. Without gradient.
    """
    with torch.no_grad():
        B, _, N = points.shape
        V = voxels
        lower = points.new_tensor(workspace.lower)[:, None]
        size = points.new_tensor(workspace.size / V)[:, None]
        scaled = (points - lower).div_(size)
        inside = (scaled.amin(1) >= 0) & (scaled.amax(1) < V)  # False for NaN
        x, y, z = scaled.int().unbind(1)  # truncation is the floor of what lies inside
        # Points outside go to many cells behind the grid: filtering would synchronise host and device, and a single cell
        # would serialise the atomic additions.
        behind = V**3 + torch.arange(N, dtype=torch.int32, device=points.device) % CELLS_BEHIND
        index = torch.where(inside, torch.add(z, torch.add(y, x, alpha=V), alpha=V), behind)
        cell = index.long()[:, None].expand(-1, 3, -1)

        grid = points.new_zeros(B, V**3 + CELLS_BEHIND, GRID_CHANNELS).transpose(1, 2)
        grid[:, :3].scatter_add_(2, cell, points)
        grid[:, 3:6].scatter_add_(2, cell, colours)
        grid[:, 9:].scatter_add_(2, cell[:, :1], points.new_ones(1).expand(B, 1, N))
        grid = grid[:, :, : V**3]
        occupied = grid[:, 9:]
        grid[:, :6] /= occupied.clamp(min=1)
        occupied.clamp_(max=1)
        grid = grid.unflatten(2, (V, V, V))
        axis = torch.arange(V, dtype=points.dtype, device=points.device) / V
        grid[:, 6:9] = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"))
        return grid


def with_goal(grid: Tensor, place: Tensor) -> Tensor:
    """Append a channel to a grid (b, c, v, v, v): 1 at places (b, 3) in voxels, less around them."""
    x, y, z = gaussian_1d(place, grid.shape[-1]).to(grid.dtype).unbind(1)
    mark = x[:, :, None, None] * y[:, None, :, None] * z[:, None, None, :]
    return torch.cat([grid, mark[:, None]], dim=1)
