"""Global descriptions of a feature map: where each channel peaks, and how high."""

from typing import Any

import torch
from torch import Tensor

from lerobot_policy_bimanual.nn.precision import at_least_float32

TEMPERATURE = 0.01
"""Of the spatial softmax (PerAct2 code): close to an arg max, hence float32 throughout."""

SMALLEST_EXPONENT = -60.0
"""Exponents are clamped here: exp(-60) still vanishes beside a peak of 1, but exp(-90) would be a denormal
number, with which CPUs compute ten times slower."""

CHUNK = 2**21
"""Voxels handled at a time, so that the passes over a large map stay in the processor's cache."""


def pool(x: Tensor) -> Tensor:
    """Spatial softmax and maximum of every channel.

    The spatial softmax is the expected coordinate, in [-1, 1], under a softmax over all voxels.

    Args:
        x: (b, c, x, y, z), any float type.

    Returns:
        (b, 4 c), at least float32: three coordinates per channel, in the order x, y, z, then the maxima.
    """
    peaks: Tensor = _Pool.apply(x.flatten(0, 1)).unflatten(0, x.shape[:2])  # pyright: ignore[reportAttributeAccessIssue]
    return torch.cat([peaks[..., :3].flatten(1), peaks[..., 3]], dim=1)


def _weights(x: Tensor, peak: Tensor) -> Tensor:
    """Softmax over (m, x, y, z) before its normalisation, in a fresh tensor."""
    scaled = (x - peak[:, None, None, None]).div_(TEMPERATURE)
    return scaled.clamp_(min=SMALLEST_EXPONENT).exp_()


def _axes(x: Tensor, dtype: torch.dtype) -> list[Tensor]:
    return [torch.linspace(-1, 1, size, dtype=dtype, device=x.device) for size in x.shape[1:]]


class _Pool(torch.autograd.Function):
    """Maps (m, x, y, z) to (m, 4): expected x, y, z and the maximum.

    The softmax is never normalised voxel by voxel: its three marginals are sums of one exponential, which the
    backward pass computes again instead of keeping several copies of the map.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        chunks, totals, indices = [], [], []
        for part in x.split(max(1, CHUNK // x[0].numel())):
            part = at_least_float32(part)
            peak, index = part.flatten(1).max(dim=1)
            weight = _weights(part, peak)
            plane = weight.sum(3)  # (m, x, y)
            marginals = (plane.sum(2), plane.sum(1), weight.sum((1, 2)))
            total = plane.sum((1, 2))
            means = [
                marginal @ axis / total
                for marginal, axis in zip(marginals, _axes(part, part.dtype), strict=True)
            ]
            chunks.append(torch.stack([*means, peak], dim=1))
            totals.append(total)
            indices.append(index)
        pooled = torch.cat(chunks)
        ctx.save_for_backward(x, pooled, torch.cat(totals), torch.cat(indices))
        return pooled

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> Tensor:
        x, pooled, total, index = ctx.saved_tensors
        grad_means, grad_peak = grad_outputs[0].split((3, 1), dim=1)
        scale = (
            grad_means / (TEMPERATURE * total)[:, None]
        )  # d mean / d x_i = p_i (axis_i - mean) / temperature
        grad = torch.empty_like(x)
        chunk = max(1, CHUNK // x[0].numel())
        for start in range(0, len(x), chunk):
            rows = slice(start, start + chunk)
            part = at_least_float32(x[rows])
            along_x, along_y, along_z = (
                scale[rows, None, i] * (axis - pooled[rows, None, i])
                for i, axis in enumerate(_axes(part, part.dtype))
            )
            weight = _weights(part, pooled[rows, 3])
            plane = along_x[:, :, None] + along_y[:, None, :]
            weight.mul_(plane[..., None] + along_z[:, None, None, :])
            weight.flatten(1).scatter_add_(1, index[rows, None], grad_peak[rows])
            grad[rows] = weight
        return grad
