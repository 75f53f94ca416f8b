"""3-D convolutions of the PerAct family: replicate borders, LeakyReLU, no normalisation."""

from typing import Any

import einops
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.layers import activate, init_activated
from lerobot_policy_bimanual.peract.config import PATCH


class _PadReplicate(torch.autograd.Function):
    """`F.pad(mode="replicate")` that keeps no input, with a backward pass that only sums the border of channels-last maps."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, before: int, after: int) -> Tensor:
        ctx.before, ctx.after = before, after
        kept = slice(None, min(after, 0) or None)
        return F.pad(x[:, :, kept, kept, kept], (before, max(after, 0)) * 3, mode="replicate")

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor, None, None]:
        grad = _fold_border(grad_outputs[0], ctx.before, max(ctx.after, 0), axis=2)
        return F.pad(grad, (0, -ctx.after) * 3) if ctx.after < 0 else grad, None, None


def _fold_border(grad: Tensor, before: int, after: int, axis: int) -> Tensor:
    """Add the border of a map to the voxels that it repeats, from `axis` on; a fresh, smaller tensor."""
    if axis == grad.ndim:
        return grad.clone()
    size = grad.shape[axis] - before - after
    folded = _fold_border(grad.narrow(axis, before, size), before, after, axis + 1)
    for width, start, index in ((before, 0, 0), (after, before + size, size - 1)):
        if width:
            border = grad.narrow(axis, start, width).sum(axis, keepdim=True)
            folded.narrow(axis, index, 1).add_(_fold_border(border, before, after, axis + 1))
    return folded


def pad_replicate(x: Tensor, before: int, after: int) -> Tensor:
    """Grow (b, c, x, y, z) by so many voxels at the beginning and the end of each axis, repeating the border.

    A negative `after` drops voxels instead.
    """
    return _PadReplicate.apply(x, before, after)  # pyright: ignore[reportReturnType]


class ActivatedConv3d(nn.Module):
    """Convolution with replicate borders and LeakyReLU; keeps the grid size."""

    def __init__(self, inputs: int, outputs: int, kernel: int):
        super().__init__()
        self.padding = kernel // 2
        self.conv = nn.Conv3d(inputs, outputs, kernel)
        init_activated(self.conv)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, x, y, z) -> (b, outputs, x, y, z)."""
        return activate(self.conv(pad_replicate(x, self.padding, self.padding)))


class PointwiseConv3d(nn.Module):
    """Convolution of single voxels and LeakyReLU; one matrix product."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.conv = nn.Conv3d(inputs, outputs, 1)
        init_activated(self.conv)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, x, y, z) -> (b, outputs, x, y, z), channels last in memory."""
        voxels = x.permute(0, 2, 3, 4, 1)
        return activate(F.linear(voxels, self.conv.weight.flatten(1), self.conv.bias)).permute(0, 4, 1, 2, 3)


class PatchConv3d(nn.Module):
    """Convolution of every patch to one token, and LeakyReLU; a reshape and one matrix product.

    Args:
        inputs: channels of the map.
        outputs: width of a token.
        centred: PerAct2 centres patch i on voxel 5i instead of covering voxels 5i to 5i + 4, by padding two
            voxels in front, so the last two voxels of every axis are in no patch.
    """

    def __init__(self, inputs: int, outputs: int, *, centred: bool):
        super().__init__()
        self.shift = PATCH // 2 if centred else 0
        self.conv = nn.Conv3d(inputs, outputs, PATCH)
        init_activated(self.conv)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, v, v, v) -> (b, p^3, outputs), the last axis of the grid fastest."""
        x = pad_replicate(x, self.shift, -self.shift) if self.shift else x
        patches = einops.rearrange(
            x.permute(0, 2, 3, 4, 1),  # first, or the gradient would lose the memory format
            "b (x i) (y j) (z k) c -> b (x y z) (i j k c)",
            i=PATCH,
            j=PATCH,
            k=PATCH,
        )
        return activate(F.linear(patches, self.row_weight(), self.conv.bias))

    def row_weight(self) -> Tensor:
        """(outputs, PATCH^3 inputs), the channels fastest."""
        return einops.rearrange(self.conv.weight, "o c i j k -> o (i j k c)")
