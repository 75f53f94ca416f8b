"""LAMB does the reference's arithmetic, the fused AdamW that of LeRobot's."""

import numpy as np
import torch
from lerobot.optim.optimizers import AdamWConfig

from lerobot_policy_bimanual.keypose.optimizers import FusedAdamWConfig, LambConfig


def written_out_lamb(weight: np.ndarray, gradients: list[np.ndarray], config: LambConfig) -> np.ndarray:
    first, second = np.zeros_like(weight), np.zeros_like(weight)
    for gradient in gradients:
        first = config.betas[0] * first + (1 - config.betas[0]) * gradient
        second = config.betas[1] * second + (1 - config.betas[1]) * gradient**2
        direction = first / (np.sqrt(second) + config.eps) + config.weight_decay * weight
        norm = min(np.linalg.norm(weight), 10.0)
        ratio = norm / np.linalg.norm(direction) if norm > 0 and np.linalg.norm(direction) > 0 else 1.0
        weight = weight - config.lr * ratio * direction
    return weight


def test_steps_equal_the_written_out_formula():
    config = LambConfig(weight_decay=0.01)
    starts = [torch.randn(4, 3), torch.zeros(5), 100 * torch.randn(6)]  # one zero, one beyond the clamp
    gradients = [[torch.randn_like(start) for start in starts] for _ in range(3)]
    weights = [torch.nn.Parameter(start.clone()) for start in starts]
    optimizer = config.build(weights)
    for step in gradients:
        for weight, gradient in zip(weights, step, strict=True):
            weight.grad = gradient.clone()
        optimizer.step()
    for index, weight in enumerate(weights):
        history = [step[index].double().numpy() for step in gradients]
        expected = written_out_lamb(starts[index].double().numpy(), history, config)
        np.testing.assert_allclose(weight.detach().numpy(), expected, rtol=1e-5, atol=1e-6)


def test_fused_adamw_takes_the_steps_of_lerobots_adamw():
    start = torch.randn(40, 30)
    gradients = torch.randn(5, 40, 30)
    ends = []
    for config in (AdamWConfig(lr=0.01), FusedAdamWConfig(lr=0.01)):
        weight = torch.nn.Parameter(start.clone())
        optimizer = config.build([weight])
        for gradient in gradients:
            weight.grad = gradient.clone()
            optimizer.step()
        ends.append(weight.detach())
    torch.testing.assert_close(*ends, rtol=1e-6, atol=1e-7)
    assert not torch.equal(ends[0], start)
