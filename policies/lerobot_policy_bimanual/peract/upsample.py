"""Trilinear upsampling, a convolution and its activation, with twenty times fewer multiplications.

Interpolation and convolution are linear, so they commute: every tap of the kernel is applied to the coarse map, and its
result is interpolated at the positions that the tap reads, by one small fixed matrix per axis. This is exact, borders and
gradients included.
"""

from typing import Any

import torch
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.layers import LEAK, activate, init_activated
from lerobot_policy_bimanual.nn.precision import at_least_float32
from lerobot_policy_bimanual.peract.config import PATCH

KERNEL = PATCH
COARSE_TAPS = 3
"""Coarse voxels that a fine kernel reaches along one axis."""

CHUNK_CPU, CHUNK_GPU = 2**21, 2**26
"""Elements processed at a time: what fits a CPU's cache, and what fills a GPU."""


def interpolation_weights(position: Tensor, size: int) -> Tensor:
    """Weights (..., size) with which linear interpolation reads a line of values at fractional indices (...)."""
    distance = position[..., None] - torch.arange(size, device=position.device)
    return (1 - distance.abs()).clamp(min=0)


def coarse_position(fine: Tensor, factor: int = PATCH) -> Tensor:
    """Fractional coarse index of the centre of a fine voxel (align_corners=False), float64."""
    return (fine.double() - factor // 2) / factor


def tap_mixture(device: torch.device | None, factor: int = PATCH) -> Tensor:
    """How the taps of a fine kernel, `factor` wide, act on the coarse map along one axis.

    Returns:
        (factor, COARSE_TAPS, factor) float64. Entry [p, t, i]: weight of the coarse voxel n + t - 1 in the
        interpolated value that tap i reads for the fine voxel factor * n + p.
    """
    phase = torch.arange(factor, device=device)[:, None]
    tap = torch.arange(factor, device=device) - factor // 2
    return interpolation_weights(coarse_position(phase + tap, factor) + 1, COARSE_TAPS).transpose(1, 2)


def tap_reading(size: int, device: torch.device) -> Tensor:
    """The same for a whole axis of `size` coarse voxels, with replicate borders, as one matrix.

    Returns:
        (PATCH * size + 2, KERNEL * size) float64: rows are fine voxels, with one more at either end; columns are
        pairs of tap and coarse voxel.
    """
    last = PATCH * size - 1
    fine = torch.arange(-1, last + 2, device=device).clamp(0, last)[:, None]
    tap = torch.arange(KERNEL, device=device) - KERNEL // 2
    position = coarse_position((fine + tap).clamp(0, last)).clamp(0, size - 1)
    return interpolation_weights(position, size).flatten(1)


class UpsampledConv3d(nn.Module):
    """Trilinear upsampling by `PATCH`, a 5x5x5 convolution with replicate borders, and LeakyReLU."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.conv = nn.Conv3d(inputs, outputs, KERNEL)
        init_activated(self.conv)

    def kernel(self) -> Tensor:
        """The kernel, mixed along x for every output phase; shared by the arms.

        Returns:
            (COARSE_TAPS * inputs, PATCH * KERNEL * KERNEL * outputs), columns ordered by phase, z tap, y tap.
        """
        weight = self.conv.weight
        mixture = tap_mixture(weight.device).to(weight.dtype)
        return torch.einsum("pti,ocijk->tcpkjo", mixture, weight).flatten(2).flatten(0, 1)

    def forward(self, x: Tensor, kernel: Tensor) -> Tensor:
        """Coarse map (b, inputs, n, n, n) and `kernel()` -> fine map (b, outputs, PATCH * n + 2, ...), channels last in memory.

        Its border is repeated once on all sides, as the next convolution wants it.
        """
        X, Y, Z = x.shape[2:]
        coarse = x.permute(0, 2, 3, 4, 1)
        padded = torch.cat([coarse[:, :1], coarse, coarse[:, -1:]], dim=1)
        windows = torch.cat([padded[:, t : t + X] for t in range(COARSE_TAPS)], dim=-1)
        along_y, along_z = (tap_reading(size, x.device).to(x.dtype) for size in (Y, Z))
        bias: Any = self.conv.bias
        fine: Any = _Interpolate.apply(windows, kernel.to(x.dtype), bias.to(x.dtype), along_y, along_z)
        return fine


class _Interpolate(torch.autograd.Function):
    """Maps windows (b, X, Y, Z, taps * c) of the coarse map to the activated, padded fine map.

    One function, because the products of all taps are several times as large as the fine map: they are computed for a few
    coarse planes at a time, and are not kept.
    """

    @staticmethod
    def forward(
        ctx: Any, windows: Tensor, kernel: Tensor, bias: Tensor, along_y: Tensor, along_z: Tensor
    ) -> Tensor:
        B, X, Y, Z, _ = windows.shape
        outputs = len(bias)
        height, width = len(along_y), len(along_z)
        fine = windows.new_empty(B, PATCH * X + 2, height, width, outputs)
        for sample, planes in zip(windows, fine, strict=True):
            for start, window in _chunks(sample, PATCH * height * width * outputs):
                taps = (window.flatten(0, 2) @ kernel).view(-1, Y, Z, PATCH, KERNEL, KERNEL, outputs)
                taps = taps.permute(0, 3, 4, 5, 1, 2, 6).reshape(-1, KERNEL * Y, Z * outputs)
                rows = (along_y @ taps).view(-1, KERNEL, height, Z * outputs)
                rows = rows.transpose(1, 2).reshape(-1, KERNEL * Z, outputs)
                part = activate((along_z @ rows).add_(bias)).view(-1, height, width, outputs)
                first = 1 + PATCH * start
                planes[first : first + len(part)] = part
            planes[0], planes[-1] = planes[1], planes[-2]
        ctx.save_for_backward(windows, kernel, along_y, along_z, fine)
        return fine.permute(0, 4, 1, 2, 3)

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor | None, ...]:
        windows, kernel, along_y, along_z, fine = ctx.saved_tensors
        _, _, Y, Z, _ = windows.shape
        height, width, outputs = fine.shape[2:]
        grad_windows = torch.empty_like(windows)
        grad_kernel = torch.zeros_like(at_least_float32(kernel))
        grad_bias = at_least_float32(kernel).new_zeros(outputs)
        grad_fine = grad_outputs[0].permute(0, 2, 3, 4, 1)
        for sample, planes, grad_planes, grad_sample in zip(
            windows, fine, grad_fine, grad_windows, strict=True
        ):
            for start, window in _chunks(sample, PATCH * height * width * outputs):
                first, end = 1 + PATCH * start, 1 + PATCH * (start + len(window))
                grad = _leaky_relu_gradient(grad_planes[first:end], planes[first:end])
                if start == 0:  # the border repeats the first plane and the last one
                    grad[0] += _leaky_relu_gradient(grad_planes[0], planes[0])
                if end == len(planes) - 1:
                    grad[-1] += _leaky_relu_gradient(grad_planes[-1], planes[-1])
                grad_bias += grad.flatten(0, 2).sum(0)
                rows = along_z.T @ grad.view(-1, width, outputs)
                rows = rows.view(-1, height, KERNEL, Z * outputs).transpose(1, 2)
                taps = along_y.T @ rows.reshape(-1, height, Z * outputs)
                taps = taps.view(-1, PATCH, KERNEL, KERNEL, Y, Z, outputs).permute(0, 4, 5, 1, 2, 3, 6)
                taps = taps.reshape(-1, kernel.shape[1])
                grad_kernel += window.flatten(0, 2).T @ taps
                grad_sample[start : start + len(window)] = (taps @ kernel.T).view_as(window)
        return grad_windows, grad_kernel.to(kernel.dtype), grad_bias.to(kernel.dtype), None, None


def _chunks(sample: Tensor, outputs_per_plane: int) -> list[tuple[int, Tensor]]:
    """A few coarse planes at a time, each with the index of its first."""
    budget = CHUNK_GPU if sample.is_cuda else CHUNK_CPU
    size = max(1, budget // outputs_per_plane)
    return [(start, sample[start : start + size]) for start in range(0, len(sample), size)]


def _leaky_relu_gradient(grad: Tensor, activated: Tensor) -> Tensor:
    """Gradient before the LeakyReLU from the one behind it, in a fresh contiguous tensor."""
    return torch.ops.aten.leaky_relu_backward(grad.contiguous(), activated, LEAK, True)
