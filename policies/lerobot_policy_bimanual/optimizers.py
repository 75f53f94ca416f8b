"""LAMB as PerAct2's reference uses it."""

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

import torch
from lerobot.optim import OptimizerConfig
from torch import Tensor

MAX_WEIGHT_NORM = 10.0
"""Weight norms are clamped to this before the trust ratio (PerAct2 code)."""


class Lamb(torch.optim.Optimizer):
    """Layer-wise adaptive moments: Adam's direction, scaled per tensor to the norm of its weights.

    As in PerAct2's reference there is no bias correction, and weight decay is part of the direction. All
    arithmetic stays on the device: no value is read back.

    Args:
        params: Parameters or parameter groups.
        lr: Learning rate.
        betas: Decay rates of both moments.
        eps: Added to the root of the second moment.
        weight_decay: Weight decay inside the direction.
    """

    def __init__(
        self,
        params: Iterable[Tensor] | Iterable[dict[str, Any]],
        lr: float = 5e-4,
        betas: tuple[float, float] = (0.9, 0.999),
        eps: float = 1e-6,
        weight_decay: float = 1e-6,
    ):
        super().__init__(params, {"lr": lr, "betas": betas, "eps": eps, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> float | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Update all parameters that have a gradient."""
        loss = None
        if closure is not None:
            with torch.enable_grad():
                loss = closure()
        for group in self.param_groups:
            weights = [p for p in group["params"] if p.grad is not None]
            if not weights:
                continue
            for weight in weights:
                if not self.state[weight]:
                    self.state[weight] = {
                        "exp_avg": torch.zeros_like(weight),
                        "exp_avg_sq": torch.zeros_like(weight),
                    }
            self._update(
                weights,
                [p.grad for p in weights],
                [self.state[p]["exp_avg"] for p in weights],
                [self.state[p]["exp_avg_sq"] for p in weights],
                group,
            )
        return loss

    @staticmethod
    def _update(
        weights: list[Tensor], gradients: list[Any], first: list[Tensor], second: list[Tensor], group: dict
    ) -> None:
        beta1, beta2 = group["betas"]
        torch._foreach_lerp_(first, gradients, 1 - beta1)
        torch._foreach_mul_(second, beta2)
        torch._foreach_addcmul_(second, gradients, gradients, 1 - beta2)
        denominators = torch._foreach_sqrt(second)
        torch._foreach_add_(denominators, group["eps"])
        directions = torch._foreach_div(first, denominators)
        torch._foreach_add_(directions, weights, alpha=group["weight_decay"])
        weight_norms = torch._foreach_norm(weights)
        direction_norms = torch._foreach_norm(directions)
        for weight, direction, weight_norm, direction_norm in zip(
            weights, directions, weight_norms, direction_norms, strict=True
        ):
            ratio = weight_norm.clamp(max=MAX_WEIGHT_NORM) / direction_norm
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
        """Make the optimizer."""
        options = asdict(self)
        options.pop("grad_clip_norm")
        return Lamb(params, **options)
