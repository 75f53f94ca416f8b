"""Three flat views of the voxel features, along x, y and z, and convolutions that see far across them."""

from collections.abc import Sequence
from typing import Any

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.activation import LEAK


def project(features: Tensor) -> list[Tensor]:
    """Maxima (b, channels, v, v) of voxel features (b, channels, v, v, v) along x, y and z."""
    planes: Any = _Project.apply(features.permute(0, 2, 3, 4, 1))
    return [plane.permute(0, 3, 1, 2) for plane in planes]


class _Project(torch.autograd.Function):
    """Maps (b, x, y, z, c) to its maxima along x, y and z, with one gradient map for all three."""

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> tuple[Tensor, ...]:
        planes, places = zip(*(x.max(dim=axis) for axis in (1, 2, 3)), strict=True)
        ctx.shape = x.shape
        ctx.save_for_backward(*places)
        return planes

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> Tensor:
        grad = grad_outputs[0].new_zeros(ctx.shape)
        for axis, (place, grad_plane) in enumerate(zip(ctx.saved_tensors, grad_outputs, strict=True), 1):
            grad.scatter_add_(axis, place.unsqueeze(axis), grad_plane.unsqueeze(axis))
        return grad


class ProjectionConv2d(nn.Conv2d):
    """A 3 x 3 convolution, and dilated ones that add what lies further away.

    Every layer reaches as many voxels further as its dilation. With 3 and 9 after the first one any place up to 13
    voxels away on either side is reached, each in one way: half of a grid of 25.

    Args:
        channels: channels of the projections.
        width: channels of what is made of them.
        dilations: of the layers after the first; none for the 3 x 3 convolution alone.
    """

    def __init__(self, channels: int, width: int, dilations: Sequence[int]):
        super().__init__(channels, width, 3, padding=1)
        self.far = nn.ModuleList(
            nn.Conv2d(width, width, 3, padding=dilation, dilation=dilation) for dilation in dilations
        )

    def forward(self, input: Tensor) -> Tensor:
        """(b, channels, v, v) to (b, width, v, v)."""
        features = super().forward(input)
        for layer in self.far:
            features = features + layer(F.leaky_relu(features, LEAK))
        return features
