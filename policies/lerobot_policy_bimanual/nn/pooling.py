"""Global descriptions of a feature map: where each channel peaks, and how high."""

import torch
from torch import Tensor

from lerobot_policy_bimanual.nn.precision import at_least_float32

TEMPERATURE = 0.01
"""Of the spatial softmax (PerAct2 code): close to an arg max, hence float32 throughout."""

SMALLEST_EXPONENT = -60.0
"""Exponents are clamped here: exp(-60) still vanishes beside a peak of 1, but exp(-90) would be a denormal
number, with which CPUs compute ten times slower."""


def spatial_softmax(x: Tensor) -> Tensor:
    """Expected coordinates, in [-1, 1], of each channel's softmax over the grid.

    The softmax is never normalised voxel by voxel: its three marginals are sums of one exponential.

    Args:
        x: (b, c, x, y, z), any float type.

    Returns:
        (b, c, 3) at least float32, in the order x, y, z.
    """
    x = at_least_float32(x)
    peak = x.detach().amax((2, 3, 4), keepdim=True)
    weight = ((x - peak) / TEMPERATURE).clamp(min=SMALLEST_EXPONENT).exp()
    plane = weight.sum(4)  # (b, c, x, y)
    marginals = (plane.sum(3), plane.sum(2), weight.sum((2, 3)))
    total = marginals[0].sum(-1)
    means = [
        (marginal * torch.linspace(-1, 1, marginal.shape[-1], dtype=x.dtype, device=x.device)).sum(-1) / total
        for marginal in marginals
    ]
    return torch.stack(means, dim=-1)


def pool(x: Tensor) -> Tensor:
    """Spatial softmax and maximum of every channel: (b, c, x, y, z) -> (b, 4 c), at least float32."""
    return torch.cat(
        [spatial_softmax(x).flatten(1), at_least_float32(x.flatten(2).max(dim=-1).values)], dim=1
    )
