"""3-D convolutions of the PerAct family: replicate borders, LeakyReLU, no normalisation."""

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

PATCH = 5
"""Voxels per patch along each axis (PerAct2 code)."""

LEAK = 0.02
"""Slope of every LeakyReLU (PerAct2 code; not PyTorch's 0.01)."""


def activate(x: Tensor) -> Tensor:
    """LeakyReLU of the PerAct family, in place: callers hand over a fresh tensor."""
    return F.leaky_relu(x, LEAK, inplace=True)


def pad_replicate(x: Tensor, width: int) -> Tensor:
    """Grow (b, c, x, y, z) by `width` voxels on all six sides, repeating the border."""
    return F.pad(x, (width,) * 6, mode="replicate") if width else x


def init_activated(layer: nn.Conv3d | nn.Linear) -> None:
    """Kaiming-uniform weights and zero bias, for layers followed by `activate`."""
    nn.init.kaiming_uniform_(layer.weight, a=LEAK, nonlinearity="leaky_relu")
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


def init_linear(layer: nn.Conv3d | nn.Linear) -> None:
    """Xavier-uniform weights and zero bias, for layers without activation."""
    nn.init.xavier_uniform_(layer.weight)
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


class ActivatedConv3d(nn.Module):
    """Convolution with replicate borders and LeakyReLU; keeps the grid size at stride 1."""

    def __init__(
        self, inputs: int, outputs: int, kernel: int, *, stride: int = 1, padding: int | None = None
    ):
        super().__init__()
        self.padding = kernel // 2 if padding is None else padding
        self.conv = nn.Conv3d(inputs, outputs, kernel, stride)
        init_activated(self.conv)

    def forward(self, x: Tensor) -> Tensor:
        """(b, inputs, x, y, z) -> (b, outputs, x', y', z')."""
        return activate(self.conv(pad_replicate(x, self.padding)))


class ActivatedLinear(nn.Linear):
    """Linear layer and LeakyReLU."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__(inputs, outputs)
        init_activated(self)

    def forward(self, input: Tensor) -> Tensor:
        """(..., inputs) -> (..., outputs)."""
        return activate(super().forward(input))
