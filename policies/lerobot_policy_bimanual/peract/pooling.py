"""Spatial softmax and maximum of every channel of a feature map."""

from typing import Any

import torch
from torch import Tensor

from lerobot_policy_bimanual.nn.precision import at_least_float32

TEMPERATURE = 0.01
"""Temperature of the spatial softmax (PerAct2 code): close to an arg max, hence float32 throughout."""

MIN_EXPONENT = -60.0
"""Exponents are clamped here: exp(-60) still vanishes beside a peak of 1, but exp(-90) would be a denormal
number, with which CPUs compute ten times slower."""

CHUNK_CPU, CHUNK_GPU = 2**20, 2**26
"""Elements processed at a time: what fits a CPU's cache, and what fills a GPU."""


def pool(x: Tensor) -> Tensor:
    """Spatial softmax and maximum of every channel.

    The spatial softmax is the expected coordinate, in [-1, 1], under a softmax over all voxels.

    Args:
        x: (b, c, x, y, z), any float type; fastest with the channels last in memory.

    Returns:
        (b, 4 c), at least float32: three coordinates per channel, in the order x, y, z, then the maxima.
    """
    peaks: Tensor = _Pool.apply(x.permute(0, 2, 3, 4, 1).contiguous())  # pyright: ignore[reportAssignmentType]
    return torch.cat([peaks[..., :3].flatten(1), peaks[..., 3]], dim=1)


def _weights(x: Tensor, peak: Tensor) -> Tensor:
    """Softmax over (b, x, y, z, c) before its normalisation, at least float32, in a fresh tensor."""
    scaled = torch.sub(at_least_float32(x), peak[:, None, None, None]).div_(TEMPERATURE)
    return scaled.clamp_(min=MIN_EXPONENT).exp_()


def _argmax(x: Tensor) -> Tensor:
    """Flat voxel index (b, c) of the maximum of a map (b, x, y, z, c), over lines first, which is ten times as fast."""
    lines = x.amax(3).flatten(1, 2)
    line = lines.argmax(1, keepdim=True)  # (b, 1, c)
    along = x.flatten(1, 2).gather(1, line[:, :, None].expand(-1, -1, x.shape[3], -1))  # (b, 1, z, c)
    return line[:, 0] * x.shape[3] + along[:, 0].argmax(1)


def _axes(x: Tensor, dtype: torch.dtype) -> list[Tensor]:
    return [torch.linspace(-1, 1, size, dtype=dtype, device=x.device) for size in x.shape[1:4]]


def _slabs(x: Tensor) -> list[slice]:
    """A few planes of a map (b, x, y, z, c) at a time."""
    size = max(1, (CHUNK_GPU if x.is_cuda else CHUNK_CPU) // x[:, 0].numel())
    return [slice(start, start + size) for start in range(0, x.shape[1], size)]


class _Pool(torch.autograd.Function):
    """Maps (b, x, y, z, c) to (b, c, 4): expected x, y, z and the maximum.

    The softmax is never normalised voxel by voxel: its three marginals are sums of one exponential, which the backward
    pass recomputes instead of keeping copies of the map.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        index = _argmax(x)
        peak = at_least_float32(x.flatten(1, 3).gather(1, index[:, None])[:, 0])
        planes, over_xy = [], peak.new_zeros(len(x), *x.shape[3:])
        for slab in _slabs(x):
            weight = _weights(x[:, slab], peak)
            planes.append(weight.sum(3))
            over_xy += weight.sum((1, 2))
        plane = torch.cat(planes, dim=1)  # (b, x, y, c)
        total = plane.sum((1, 2))
        marginals = (plane.sum(2), plane.sum(1), over_xy)
        means = [  # not as matrix products, which autocast would do in half precision
            (axis[:, None] * marginal).sum(1) / total
            for axis, marginal in zip(_axes(x, peak.dtype), marginals, strict=True)
        ]
        pooled = torch.stack([*means, peak], dim=-1)
        ctx.save_for_backward(x, pooled, total, index)
        return pooled

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> Tensor:
        x, pooled, total, index = ctx.saved_tensors
        grad_pooled = grad_outputs[0]
        # d mean / d x_i = p_i (axis_i - mean) / temperature
        scale = grad_pooled[..., :3] / (TEMPERATURE * total)[..., None]
        along_x, along_y, along_z = (
            (axis[:, None] - pooled[:, None, :, i]) * scale[:, None, :, i]  # (b, size, c)
            for i, axis in enumerate(_axes(x, pooled.dtype))
        )
        plane = along_y[:, :, None] + along_z[:, None]  # (b, y, z, c)
        grad = torch.empty_like(x)
        for slab in _slabs(x):
            weight = _weights(x[:, slab], pooled[..., 3])
            grad[:, slab] = weight.mul_(plane[:, None] + along_x[:, slab, None, None])
        grad_peak = grad_pooled[:, None, :, 3].to(grad.dtype)
        grad.view(len(x), -1, x.shape[-1]).scatter_add_(1, index[:, None], grad_peak)
        return grad
