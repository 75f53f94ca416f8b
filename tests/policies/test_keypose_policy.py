"""What all keypose policies do around their networks, tried on the smallest PerAct2."""

import math
from collections.abc import Iterator

import pytest
import torch
from torch import Tensor

from lerobot_bimanual.dataset.schema import GRIPPER_FINGERS, KEYPOSE_STEP, STATE
from lerobot_policy_bimanual import PerAct2Config, PerAct2Policy
from lerobot_policy_bimanual.keypose.losses import keypose_errors
from lerobot_policy_bimanual.keypose.optimizers import LambConfig
from lerobot_policy_bimanual.nn.language import MAX_WORDS, LearnedLanguage
from lerobot_policy_bimanual.nn.precision import full_precision
from lerobot_policy_bimanual.nn.wordllama import WordllamaLanguage
from lerobot_policy_bimanual.peract.dense_head import LogitConv3d, SkipConv3d
from lerobot_policy_bimanual.peract.pooling import pool
from lerobot_policy_bimanual.peract.upsample import UpsampledConv3d


def test_report_holds_plain_numbers_and_adds_up_to_the_loss(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny)).train()
    loss, report = policy(make_batch())
    assert all(type(value) is float for value in report.values())
    parts = sum(value for name, value in report.items() if name.endswith("_loss"))
    assert loss.item() == pytest.approx(parts, rel=1e-5)
    assert {"left_position_cm", "right_rotation_deg", "left_far"} <= report.keys()


def test_proprioception_is_per_arm_left_first_and_time_runs_over_the_horizon(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny | {"keypose_horizon": 5}))
    batch = make_batch(samples=4)
    batch[KEYPOSE_STEP] = torch.tensor([[0.0], [2.0], [4.0], [9.0]])
    batch[STATE] = torch.eye(16)[7].expand(4, 16)  # the left gripper is open
    batch[GRIPPER_FINGERS] = torch.tensor([0.04, 0.03, 0.01, 0.0]).expand(4, 4)
    grippers, time = policy.observe(batch).proprio.view(4, 2, 4).split((3, 1), dim=2)
    torch.testing.assert_close(grippers[0], torch.tensor([[1.0, 1.0, 0.75], [0.0, 0.25, 0.0]]))
    assert time[..., 0].tolist() == [[1.0] * 2, [0.0] * 2, [-1.0] * 2, [-1.0] * 2]


def test_outer_autocast_touches_neither_geometry_nor_losses(tiny, make_batch):
    policy, batch = PerAct2Policy(PerAct2Config(**tiny)).eval(), make_batch()
    loss, report = policy(batch)
    with torch.autocast("cpu", torch.bfloat16):
        under_autocast = policy(batch)
    assert torch.equal(under_autocast[0], loss)
    assert under_autocast[1] == report


def test_keypose_errors_equal_the_offsets_that_the_test_adds(random_keyposes):
    truth = random_keyposes(4).view(4, 2, 9)
    truth[:, 0, 3:7] = torch.tensor([1.0, 0.0, 0.0, 0.0])
    predicted = truth.clone()
    predicted[:, 0, 0] += 0.03
    predicted[:2, 1, 2] -= 0.08
    half = math.radians(10) / 2
    predicted[:, 0, 3:7] = torch.tensor([math.cos(half), 0.0, 0.0, math.sin(half)])
    found = keypose_errors(predicted.flatten(1), truth.flatten(1))
    expected = {"left_position_cm": 3.0, "left_rotation_deg": 10.0, "left_far": 0.0}
    expected |= {"right_position_cm": 4.0, "right_rotation_deg": 0.0, "right_far": 0.5}
    assert {name: value.item() for name, value in found.items()} == pytest.approx(expected, abs=1e-2)


def written_out_lamb(weight: Tensor, gradients: list[Tensor], config: LambConfig) -> Tensor:
    first, second = torch.zeros_like(weight), torch.zeros_like(weight)
    for gradient in gradients:
        first = config.betas[0] * first + (1 - config.betas[0]) * gradient
        second = config.betas[1] * second + (1 - config.betas[1]) * gradient**2
        direction = first / (second.sqrt() + config.eps) + config.weight_decay * weight
        norm = weight.norm().clamp(max=10)
        ratio = norm / direction.norm() if norm > 0 and direction.norm() > 0 else 1.0
        weight = weight - config.lr * ratio * direction
    return weight


def test_steps_of_lamb_equal_the_written_out_formula():
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
        history = [step[index].double() for step in gradients]
        expected = written_out_lamb(starts[index].double(), history, config).float()
        torch.testing.assert_close(weight.detach(), expected, rtol=1e-5, atol=1e-6)


def test_word_ids_are_stable_and_the_tokens_of_a_sentence_do_not_depend_on_its_batch():
    language = LearnedLanguage(tokens=5, dim=7).eval()
    red, blue, swapped = language(["press the red button", "press the blue button", "button red the press"])
    assert not torch.allclose(red, blue)
    assert not torch.allclose(red, swapped)
    beside_a_longer_one = language(["press the red button", "push the very heavy box over to the red area"])
    assert beside_a_longer_one.shape == (2, 5, 7)
    torch.testing.assert_close(beside_a_longer_one[0], red)
    assert language._ids("Lift the BALL!") == language._ids("lift the ball")
    assert language._ids("lift ball") == [0, 1918, 118]  # a checkpoint relies on these


@pytest.mark.parametrize("encoder", [LearnedLanguage, WordllamaLanguage])
@pytest.mark.parametrize("instruction", ["", "  ?!", "défense d'afficher 機械", "\ud800", "word " * 300])
def test_no_sentence_is_refused(encoder, instruction):
    language = encoder(tokens=3, dim=4)
    assert torch.isfinite(language([instruction, "lift the ball"])).all()
    assert len(language._ids(instruction)) <= MAX_WORDS


DEVICE = "cuda" if torch.cuda.is_available() else "cpu"


def test_decoder_gradients_in_bfloat16_stay_close():
    coarse = torch.randn(2, 8, 3, 3, 3).to(DEVICE).requires_grad_()
    stem = torch.randn(2, 8, 15, 15, 15).to(DEVICE)
    upsample = UpsampledConv3d(8, 8).to(DEVICE)
    join, logits = SkipConv3d(8).to(DEVICE), LogitConv3d(8).to(DEVICE)
    gradients = []
    for is_half in (False, True):
        with torch.autocast(DEVICE, torch.bfloat16, enabled=is_half):
            decoded = logits(join(join.skip_half(stem), upsample(coarse, upsample.kernel())))
            gradients += torch.autograd.grad(decoded.square().sum(), coarse)
    full, half = gradients
    assert (half - full).norm() < 0.05 * full.norm()


def test_spatial_softmax_of_float32_features_ignores_autocast():
    features = torch.randn(2, 3, 5, 5, 5).to(DEVICE)
    with torch.autocast(DEVICE, torch.bfloat16):
        half = pool(features)
    assert torch.equal(pool(features), half)


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
