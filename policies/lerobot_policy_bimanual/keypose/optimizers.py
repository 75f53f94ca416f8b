"""Optimizers of keypose policies: LAMB as PerAct2's reference uses it, and AdamW in one pass per parameter."""

from dataclasses import asdict, dataclass
from typing import Any

import torch
from lerobot.optim import OptimizerConfig
from lerobot.optim.optimizers import AdamWConfig
from torch import Tensor

MAX_WEIGHT_NORM = 10.0
"""Weight norms are clamped to this before the trust ratio (PerAct2 code)."""


class Lamb(torch.optim.Optimizer):
    """Layer-wise adaptive moments: Adam's direction, scaled per tensor to the norm of its weights.

    As in PerAct2's reference there is no bias correction, and weight decay is part of the direction. All
    arithmetic stays on the device: no value is read back.
    """

    def __init__(
        self, params: Any, *, lr: float, betas: tuple[float, float], eps: float, weight_decay: float
    ):
        super().__init__(params, {"lr": lr, "betas": betas, "eps": eps, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Update all parameters that have a gradient; a closure is not supported."""
        for group in self.param_groups:
            for weight in group["params"]:
                if weight.grad is not None:
                    self._update(weight, group)

    def _update(self, weight: Tensor, group: dict[str, Any]) -> None:
        state = self.state[weight]
        if not state:
            state["exp_avg"] = torch.zeros_like(weight)
            state["exp_avg_sq"] = torch.zeros_like(weight)
        beta1, beta2 = group["betas"]
        first = state["exp_avg"].lerp_(weight.grad, 1 - beta1)
        second = state["exp_avg_sq"].mul_(beta2).addcmul_(weight.grad, weight.grad, value=1 - beta2)
        direction = first / (second.sqrt() + group["eps"]) + group["weight_decay"] * weight
        weight_norm, direction_norm = weight.norm(), direction.norm()
        ratio = weight_norm.clamp(max=MAX_WEIGHT_NORM) / direction_norm
        # Zero-initialised tensors, such as biases at the start, move at the plain learning rate.
        ratio = torch.where((weight_norm > 0) & (direction_norm > 0), ratio, torch.ones_like(ratio))
        weight.addcmul_(direction, ratio, value=-group["lr"])


@OptimizerConfig.register_subclass("lamb")
@dataclass
class LambConfig(OptimizerConfig):
    """LAMB with the reference's numbers; `grad_clip_norm=0` means no clipping."""

    lr: float = 5e-4
    betas: tuple[float, float] = (0.9, 0.999)
    eps: float = 1e-6
    weight_decay: float = 1e-6
    grad_clip_norm: float = 0.0

    def build(self, params: Any) -> torch.optim.Optimizer:
        """The optimizer of parameters or groups of parameters."""
        return Lamb(params, **_options(self))


@OptimizerConfig.register_subclass("fused_adamw")
@dataclass
class FusedAdamWConfig(AdamWConfig):
    """LeRobot's AdamW with PyTorch's fused kernel: the same update in a third of the time for small parameters."""

    def build(self, params: Any) -> torch.optim.Optimizer:
        """The optimizer of parameters or groups of parameters."""
        return torch.optim.AdamW(params, fused=True, **_options(self))


def _options(config: OptimizerConfig) -> dict[str, Any]:
    """The options of an optimizer, without those of LeRobot's training loop, which clips."""
    return {name: value for name, value in asdict(config).items() if name != "grad_clip_norm"}
