"""3-D convolutions of the PerAct family: replicate borders, LeakyReLU, no normalisation."""

from typing import Any

import einops
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

PATCH = 5
"""Voxels per patch along each axis (PerAct2 code)."""

LEAK = 0.02
"""Slope of every LeakyReLU (PerAct2 code; not PyTorch's 0.01)."""


def activate(x: Tensor) -> Tensor:
    """LeakyReLU of the PerAct family, in place: callers hand over a fresh tensor."""
    return F.leaky_relu(x, LEAK, inplace=True)


class _PadReplicate(torch.autograd.Function):
    """`F.pad(mode="replicate")` without keeping its input for the backward pass, which needs only the shape."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, width: int) -> Tensor:
        ctx.shape, ctx.width = x.shape, width
        return F.pad(x, (width,) * 6, mode="replicate")

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor, None]:
        (grad,) = grad_outputs
        shape_only = grad.new_empty(1).expand(ctx.shape)
        return torch.ops.aten.replication_pad3d_backward(grad, shape_only, (ctx.width,) * 6), None


def pad_replicate(x: Tensor, width: int) -> Tensor:
    """Grow (b, c, x, y, z) by `width` voxels on all six sides, repeating the border."""
    return _PadReplicate.apply(x, width) if width else x  # pyright: ignore[reportReturnType]


def init_activated(layer: nn.Conv3d | nn.Linear) -> None:
    """Kaiming-uniform weights and zero bias, for layers followed by `activate`."""
    nn.init.kaiming_uniform_(layer.weight, a=LEAK, nonlinearity="leaky_relu")
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


def init_linear(layer: nn.Conv3d | nn.Linear) -> None:
    """Xavier-uniform weights and zero bias, for layers without activation."""
    nn.init.xavier_uniform_(layer.weight)
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


class ActivatedConv3d(nn.Module):
    """Convolution with replicate borders and LeakyReLU; keeps the grid size."""

    def __init__(self, inputs: int, outputs: int, kernel: int):
        super().__init__()
        self.padding = kernel // 2
        self.conv = nn.Conv3d(inputs, outputs, kernel)
        init_activated(self.conv)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, x, y, z) -> (b, outputs, x, y, z)."""
        return activate(self.conv(pad_replicate(x, self.padding)))


class PatchConv3d(nn.Module):
    """Convolution of every patch to one token, and LeakyReLU; a reshape and one matrix product.

    Args:
        inputs: Channels of the map.
        outputs: Width of a token.
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
        if self.shift:
            kept = slice(None, -self.shift)
            x = F.pad(x[:, :, kept, kept, kept], (self.shift, 0) * 3, mode="replicate")
        patches = einops.rearrange(
            x, "b c (x i) (y j) (z k) -> b (x y z) (c i j k)", i=PATCH, j=PATCH, k=PATCH
        )
        return activate(F.linear(patches, self.conv.weight.flatten(1), self.conv.bias))


class ActivatedLinear(nn.Linear):
    """Linear layer and LeakyReLU."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__(inputs, outputs)
        init_activated(self)

    def forward(self, input: Tensor) -> Tensor:
        """(..., inputs) -> (..., outputs)."""
        return activate(super().forward(input))
