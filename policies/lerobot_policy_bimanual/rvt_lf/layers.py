"""Layers of RVT: 2-D convolutions with replicate borders, LeakyReLU, and group norm at the inputs."""

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from lerobot_policy_bimanual.nn.layers import activate, init_activated, init_linear
from lerobot_policy_bimanual.peract.upsample import tap_mixture

NORM_GROUPS = 4
"""Groups of every group norm (RVT code)."""


class Conv2d(nn.Conv2d):
    """Convolution of odd width with replicate borders, which keeps the image size, and LeakyReLU if `activated`."""

    def __init__(self, inputs: int, outputs: int, kernel: int, *, activated: bool):
        super().__init__(inputs, outputs, kernel, padding=kernel // 2, padding_mode="replicate")
        self.activated = activated
        (init_activated if activated else init_linear)(self)

    def forward(self, input: Tensor) -> Tensor:
        """(b, inputs, h, w) -> (b, outputs, h, w)."""
        x = super().forward(input)
        return activate(x) if self.activated else x


class PatchConv2d(nn.Module):
    """Convolution of every patch to one token, group norm over all tokens of an image, LeakyReLU."""

    def __init__(self, inputs: int, outputs: int, patch: int):
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, patch, stride=patch)
        self.norm = nn.GroupNorm(NORM_GROUPS, outputs)
        init_activated(self.conv)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, v, v) -> (b, p^2, outputs), columns fastest."""
        return activate(self.norm(self.conv(x))).flatten(2).transpose(1, 2)


class NormedLinear(nn.Module):
    """Linear layer, group norm over the channels of each vector, LeakyReLU."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.linear = nn.Linear(inputs, outputs)
        self.norm = nn.GroupNorm(NORM_GROUPS, outputs)
        init_activated(self.linear)

    def forward(self, x: Tensor) -> Tensor:
        """(..., inputs) -> (..., outputs)."""
        hidden = self.linear(x)
        return activate(self.norm(hidden.flatten(0, -2))).view_as(hidden)


class SkipConv2d(nn.Module):
    """3x3 convolution of two maps joined, and LeakyReLU, without ever joining them."""

    def __init__(self, channels: int):
        super().__init__()
        self.conv = nn.Conv2d(2 * channels, channels, 3)
        init_activated(self.conv)

    def forward(self, x: Tensor, skip: Tensor) -> Tensor:
        """(b, c, v, v) twice -> (b, c, v, v); the first half of the weights belongs to `x`."""
        for_x, for_skip = self.conv.weight.chunk(2, dim=1)
        x = F.conv2d(F.pad(x, (1,) * 4, mode="replicate"), for_x)
        return activate(x + F.conv2d(F.pad(skip, (1,) * 4, mode="replicate"), for_skip, self.conv.bias))


class UpsampledConv2d(nn.Module):
    """Bilinear upsampling by an odd factor, then a convolution of that width with replicate borders.

    Both are linear, so together they are one 3x3 convolution of the coarse map per output phase, with kernels
    that are fixed sums of the original one. Exact, borders and gradients included, and thirteen times fewer
    multiplications at the factor 11 of RVT.
    """

    phases: Tensor

    def __init__(self, inputs: int, outputs: int, factor: int):
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, factor)
        init_activated(self.conv)
        self.register_buffer("phases", tap_mixture(None, factor).float(), persistent=False)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, h, w) -> (b, outputs, factor * h, factor * w)."""
        matrix = self.phases.to(self.conv.weight.dtype)
        factor = len(matrix)
        along_rows = torch.einsum("ati,ocij->oatcj", matrix, self.conv.weight)
        kernels = torch.einsum("buj,oatcj->oabctu", matrix, along_rows)
        bias = self.conv.bias.repeat_interleave(factor**2)  # pyright: ignore[reportOptionalMemberAccess]
        x = F.pad(x, (1,) * 4, mode="replicate")
        return F.pixel_shuffle(F.conv2d(x, kernels.flatten(0, 2), bias), factor)
