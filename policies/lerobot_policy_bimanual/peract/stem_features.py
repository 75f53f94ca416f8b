"""Stem features for the factorised head, without a map of all voxels' features that autograd would keep.

The grid has no gradient and the stem is pointwise. So patch tokens, maxima along lines and crops are computed from the
grid, each in one pass, and their gradients are summed in one map, whose memory order is patch by patch.
"""

from functools import reduce
from typing import Any, cast

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from lerobot_policy_bimanual.nn.layers import LEAK, activate
from lerobot_policy_bimanual.peract.config import PATCH
from lerobot_policy_bimanual.peract.convolutions import PatchConv3d, PointwiseConv3d

TIE_BREAK = 2.0**-100
"""Far below the difference of any two different features; its multiples are exact."""


class StemFeatures:
    """The stem of a batch of voxel grids.

    Args:
        grid: (b, c, v, v, v), without gradient.
        stem: the pointwise layer.
        patchify: the layer that makes tokens of patches, which are not centred.
        filters: (b, channels, c + 1) per sample, added to the stem's weights and bias, the bias last; None for none.

    Attributes:
        tokens: (b, p^3, outputs of `patchify`), the last axis of the grid fastest.
        planes: maxima (b, channels, v, v) of the stem along x, y and z.
        along_lines: the head's features of the planes, per arm, which its `read` sets; joint decoding takes them twice.
    """

    def __init__(
        self, grid: Tensor, stem: PointwiseConv3d, patchify: PatchConv3d, filters: Tensor | None = None
    ):
        self._weight = stem.conv.weight.flatten(1).expand(len(grid), -1, -1)
        self._bias = cast(Tensor, stem.conv.bias).expand(len(grid), -1)
        if filters is not None:
            self._weight, self._bias = self._weight + filters[..., :-1], self._bias + filters[..., -1]
        self._width = grid.shape[-1]
        p = self._width // PATCH
        rows = grid.permute(0, 2, 3, 4, 1)
        for axis in (3, 2, 1):
            rows = rows.unflatten(axis, (p, PATCH))
        # (b, p, p, p, i, j, k, c): a patch is contiguous, as its token needs it
        self._rows = rows.permute(0, 1, 3, 5, 2, 4, 6, 7).contiguous()
        inputs: Any = (self._rows, self._weight, self._bias, patchify.row_weight(), patchify.conv.bias)
        if torch.is_autocast_enabled(grid.device.type):
            inputs = [each.to(torch.get_autocast_dtype(grid.device.type)) for each in inputs]
        tokens, *planes = _Read.apply(*inputs)
        self.tokens = F.leaky_relu(tokens, LEAK)
        self.planes = [plane.permute(0, 3, 1, 2) for plane in planes]
        self.along_lines: list[list[Tensor]] = []

    def crop(self, place: Tensor) -> Tensor:
        """Patches and one voxel around them, zero beyond the grid.

        Args:
            place: (b, arms, n, 3) of the patches.

        Returns:
            (b, arms, n, channels, PATCH + 2, PATCH + 2, PATCH + 2).
        """
        width = self._width
        # (b, arms, n, 3, 7)
        along = (place * PATCH)[..., None] + torch.arange(-1, PATCH + 1, device=place.device)
        in_x, in_y, in_z = ((along >= 0) & (along < width)).unbind(-2)
        inside = along.clamp(0, width - 1).unbind(-2)
        x, y, z = (offset[i] for offset, i in zip(row_offsets(width, place.device), inside, strict=True))
        row = x[..., :, None, None] + y[..., None, :, None] + z[..., None, None, :]
        exists = in_x[..., :, None, None] & in_y[..., None, :, None] & in_z[..., None, None, :]
        voxels = self._rows.flatten(1, 6)
        index = row.flatten(1)[..., None].expand(-1, -1, voxels.shape[2])
        crops = voxels.gather(1, index)
        crops = activate(_filtered(crops, self._weight, self._bias))
        return torch.where(exists[..., None], crops.unflatten(1, row.shape[1:]), 0).movedim(-1, 3)


def row_offsets(width: int, device: torch.device) -> list[Tensor]:
    """Contributions (v,) of each x, y and z to the row index of a voxel: patch by patch, then within the patch."""
    along = torch.arange(width, device=device)
    outer, inner = along // PATCH * PATCH**3, along % PATCH
    p = width // PATCH
    return [outer * p ** (2 - axis) + inner * PATCH ** (2 - axis) for axis in range(3)]


def _filtered(rows: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Rows (b, n, inputs) through filters (b, channels, inputs) and (b, channels) of their sample: (b, n, channels)."""
    return torch.baddbmm(bias[:, None], rows, weight.transpose(1, 2))


class _Read(torch.autograd.Function):
    """Maps rows (b, p, p, p, i, j, k, inputs) to tokens (b, p^3, outputs) and maxima (b, v, v, channels) along x, y, z."""

    @staticmethod
    def forward(ctx: Any, rows: Tensor, *layers: Tensor) -> tuple[Tensor, ...]:
        stem_weight, stem_bias, patch_weight, patch_bias = layers
        stem = activate(_filtered(rows.flatten(1, 6), stem_weight, stem_bias)).view(*rows.shape[:-1], -1)
        tokens = F.linear(stem.flatten(4).flatten(1, 3), patch_weight, patch_bias)
        planes = [reduce(torch.maximum, _slices(stem, axis)) for axis in range(3)]
        ctx.save_for_backward(rows, stem, patch_weight, *planes)
        return tokens, *(_patches_to_grid(plane) for plane in planes)

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor | None, ...]:
        rows, stem, patch_weight, *planes = ctx.saved_tensors
        channels = stem.shape[-1]
        grad_tokens, *grad_planes = grad_outputs
        grad_tokens = grad_tokens.flatten(0, 1)
        grad = (grad_tokens @ patch_weight).view(len(rows), -1, channels)
        offsets = row_offsets(PATCH * rows.shape[1], rows.device)
        for axis, (plane, grad_plane) in enumerate(zip(planes, grad_planes, strict=True)):
            first, second = (offset for other, offset in enumerate(offsets) if other != axis)
            winner = _patches_to_grid(_winner(_slices(stem, axis), plane))
            row = offsets[axis][winner.int()] + (first[:, None] + second)[..., None]
            grad.scatter_add_(1, row.flatten(1, 2), grad_plane.flatten(1, 2))
        grad = torch.ops.aten.leaky_relu_backward(grad.view_as(stem), stem, LEAK, True)
        grad = grad.view(len(rows), -1, channels)
        return (
            None,
            grad.transpose(1, 2) @ rows.flatten(1, 6),
            grad.sum(1),
            grad_tokens.T @ stem.view(len(grad_tokens), -1),
            grad_tokens.sum(0),
        )


def _slices(stem: Tensor, axis: int) -> list[Tensor]:
    """A map in patches (b, p, p, p, i, j, k, c), cut along an axis: (b, p, p, i, j, c) each."""
    return [part for block in stem.unbind(1 + axis) for part in block.unbind(3 + axis)]


def _winner(slices: list[Tensor], best: Tensor) -> Tensor:
    """Index of the first slice that holds the maximum `best`, for every element; int16.

    PyTorch's maximum with indices and its comparisons are not vectorised on a CPU. So slices are ranked by their distance
    from the maximum, less a tie break, with vectorised operations.
    """
    rank = torch.full_like(best, -torch.inf, dtype=torch.promote_types(best.dtype, torch.float32))
    for number, part in enumerate(slices):
        torch.maximum(rank, torch.sub(part, best).to(rank.dtype).sub_(number * TIE_BREAK), out=rank)
    return (rank / -TIE_BREAK).to(torch.int16)


def _patches_to_grid(plane: Tensor) -> Tensor:
    """(b, p, p, i, j, c) to (b, v, v, c)."""
    return plane.transpose(2, 3).flatten(3, 4).flatten(1, 2)
