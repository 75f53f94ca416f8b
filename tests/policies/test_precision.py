"""What bfloat16 may change, and what it may not."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import torch

from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.nn.precision import full_precision
from lerobot_policy_bimanual.peract.dense_head import LogitConv3d, SkipConv3d
from lerobot_policy_bimanual.peract.pooling import pool
from lerobot_policy_bimanual.peract.upsample import UpsampledConv3d
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy

DEVICE = "cuda" if torch.cuda.is_available() else "cpu"


def in_both_precisions(function: Callable[..., Any], *inputs: torch.Tensor) -> tuple[Any, Any]:
    """Results in float32 and under autocast to bfloat16."""
    inputs = tuple(x.to(DEVICE) for x in inputs)
    with torch.autocast(DEVICE, torch.bfloat16):
        half = function(*inputs)
    return function(*inputs), half


def relative_error(actual: torch.Tensor, expected: torch.Tensor) -> float:
    return ((actual.float() - expected).norm() / expected.norm()).item()


def decode(channels: int) -> Callable[..., torch.Tensor]:
    """Upsampling, skip convolution and logits, one after the other."""
    upsample = UpsampledConv3d(channels, channels).to(DEVICE)
    join, logits = SkipConv3d(channels).to(DEVICE), LogitConv3d(channels).to(DEVICE)
    return lambda coarse, stem: logits(join(join.skip_half(stem), upsample(coarse, upsample.kernel())))


def test_decoder_gradients_in_bfloat16_stay_close():
    coarse, stem = torch.randn(2, 8, 3, 3, 3), torch.randn(2, 8, 15, 15, 15)
    decoder = decode(8)

    def gradient(coarse: torch.Tensor, stem: torch.Tensor) -> torch.Tensor:
        coarse = coarse.clone().requires_grad_()
        return torch.autograd.grad(decoder(coarse, stem).square().sum(), coarse)[0]

    full, half = in_both_precisions(gradient, coarse, stem)
    assert half.dtype == torch.float32
    assert relative_error(half, full) < 0.05


def test_spatial_softmax_of_float32_features_ignores_autocast():
    full, half = in_both_precisions(pool, torch.randn(2, 3, 5, 5, 5))
    assert torch.equal(full, half)


MATMUL = torch.backends.cuda.matmul


@pytest.fixture
def tf32() -> Iterator[None]:
    """TF32 as LeRobot's programs switch it on; a process without a GPU has the setting, too."""
    MATMUL.allow_tf32 = True
    yield
    MATMUL.allow_tf32 = False


@pytest.mark.usefixtures("tf32")
def test_geometry_on_a_gpu_is_without_tf32_until_the_last_thread_has_left():
    gpu = torch.device("cuda")
    with full_precision(gpu):
        first, second = full_precision(gpu), full_precision(gpu)
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert not MATMUL.allow_tf32
        second.__exit__(None, None, None)
        assert not MATMUL.allow_tf32
    assert MATMUL.allow_tf32
    with pytest.raises(ZeroDivisionError), full_precision(gpu):
        1 / 0  # noqa: B018
    assert MATMUL.allow_tf32
    assert torch.get_float32_matmul_precision() == "high"


@pytest.mark.gpu
@pytest.mark.usefixtures("tf32")
def test_points_on_a_gpu_are_those_of_the_cpu(tiny, make_batch):
    batch = make_batch()
    policy = PerAct2Policy(PerAct2Config(**tiny))
    expected = policy.infer(batch)[0].points
    moved = {key: value.cuda() if torch.is_tensor(value) else value for key, value in batch.items()}
    torch.testing.assert_close(policy.cuda().infer(moved)[0].points.cpu(), expected, atol=1e-5, rtol=0)
