"""The LeakyReLU of PerAct and RVT, and how layers before it and without it are initialised."""

import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

LEAK = 0.02
"""Slope of every LeakyReLU (PerAct2 code; not PyTorch's 0.01)."""


def activate(x: Tensor) -> Tensor:
    """LeakyReLU of the PerAct family, in place: callers hand over a fresh tensor."""
    return F.leaky_relu(x, LEAK, inplace=True)


def init_activated(layer: nn.Conv2d | nn.Conv3d | nn.Linear) -> None:
    """Kaiming-uniform weights and zero bias, for layers followed by `activate`."""
    nn.init.kaiming_uniform_(layer.weight, a=LEAK, nonlinearity="leaky_relu")
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]


def init_linear(layer: nn.Conv2d | nn.Conv3d | nn.Linear) -> None:
    """Xavier-uniform weights and zero bias, for layers without activation."""
    nn.init.xavier_uniform_(layer.weight)
    nn.init.zeros_(layer.bias)  # type: ignore[arg-type]
