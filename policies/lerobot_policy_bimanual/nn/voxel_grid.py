"""Point clouds to voxel grids."""

import torch
from torch import Tensor

from lerobot_bimanual.geometry.workspace import Workspace

GRID_CHANNELS = 10
"""Mean xyz [m], mean RGB in [-1, 1], voxel index / voxels, occupancy 0 or 1 (PerAct2 code)."""


def voxelise(points: Tensor, colours: Tensor, *, workspace: Workspace, voxels: int) -> Tensor:
    """Average the points of every voxel.

    Only points inside the workspace are touched; the rest, NaN included, vanish.

    Args:
        points: (b, 3, n) world positions in metres.
        colours: (b, 3, n) RGB in [-1, 1].
        workspace: The box that the grid fills.
        voxels: Voxels per axis.

    Returns:
        (b, 10, voxels, voxels, voxels) float32, channels as in `GRID_CHANNELS`. Without gradient.
    """
    with torch.no_grad():
        B, _, N = points.shape
        V = voxels
        lower = points.new_tensor(workspace.lower)[:, None]
        size = points.new_tensor(workspace.size / V)[:, None]
        scaled = (points - lower) / size
        x, y, z = ((scaled >= 0) & (scaled < V)).unbind(1)
        inside = x & y & z  # False for NaN
        x, y, z = scaled.int().unbind(1)  # truncation is the floor of what lies inside
        # Points outside get a cell each behind the grid: nothing to filter, so the host need not wait for the
        # device, and no single cell that all of them fight for.
        behind = torch.arange(V**3, V**3 + N, dtype=torch.int32, device=points.device)
        cell = torch.where(inside, (x * V + y) * V + z, behind).long()[:, None]  # (b, 1, n)

        sums = points.new_zeros(B, 7, V**3 + N)
        sums[:, :3].scatter_add_(2, cell.expand(-1, 3, -1), points)
        sums[:, 3:6].scatter_add_(2, cell.expand(-1, 3, -1), colours)
        sums[:, 6:].scatter_add_(2, cell, torch.ones_like(points[:, :1]))
        sums = sums[..., : V**3]

        count = sums[:, 6:]
        axis = torch.arange(V, dtype=points.dtype, device=points.device) / V
        index = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij")).flatten(1).expand(B, -1, -1)
        grid = torch.cat([sums[:, :6] / count.clamp(min=1), index, count.clamp(max=1)], dim=1)
        return grid.unflatten(2, (V, V, V))
