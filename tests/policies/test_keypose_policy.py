"""What all keypose policies do around their networks, tried on the smallest PerAct2."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
import torch

from lerobot_bimanual.dataset.schema import ACTION, CAMERA_INTRINSICS
from lerobot_bimanual.errors import DatasetError
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.keypose.losses import keypose_errors
from lerobot_policy_bimanual.keypose.optimizers import LambConfig
from lerobot_policy_bimanual.nn.language import MAX_WORDS, LearnedLanguage
from lerobot_policy_bimanual.nn.precision import full_precision
from lerobot_policy_bimanual.nn.wordllama import WordllamaLanguage
from lerobot_policy_bimanual.peract.dense_head import LogitConv3d, SkipConv3d
from lerobot_policy_bimanual.peract.pooling import pool
from lerobot_policy_bimanual.peract.upsample import UpsampledConv3d
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy


def test_report_holds_plain_numbers_and_adds_up_to_the_loss(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny)).train()
    loss, report = policy(make_batch())
    assert all(type(value) is float for value in report.values())
    parts = sum(value for name, value in report.items() if name.endswith("_loss"))
    assert loss.item() == pytest.approx(parts, rel=1e-5)
    assert {"left_position_cm", "right_rotation_deg", "left_far"} <= report.keys()


def test_images_of_any_size_are_accepted(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny, cameras=("front", "left_wrist")))
    small, large = make_batch(size=8), make_batch(size=24)
    mixed = {key: large[key] if "left_wrist" in key else value for key, value in small.items()}
    mixed[CAMERA_INTRINSICS] = small[CAMERA_INTRINSICS].clone()
    mixed[CAMERA_INTRINSICS][:, 27:36] = large[CAMERA_INTRINSICS][:, 27:36]  # those of the left wrist
    for batch in (small, large, mixed):
        assert policy.select_action(batch).shape == (2, 18)


def test_proprioception_is_per_arm_left_first_and_time_runs_over_the_horizon(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny | {"keypose_horizon": 5}))
    batch = make_batch(samples=4)
    batch["observation.keypose_step"] = torch.tensor([[0.0], [2.0], [4.0], [9.0]])
    proprio = policy.observe(batch).proprio.view(4, 2, 4)
    assert proprio[:, :, 3].tolist() == [[1.0] * 2, [0.0] * 2, [-1.0] * 2, [-1.0] * 2]
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch(samples=1)
    batch["observation.state"] = torch.zeros(1, 16)
    batch["observation.state"][0, 7] = 1.0
    batch["observation.gripper_fingers"] = torch.tensor([[0.04, 0.03, 0.01, 0.0]])
    proprio = policy.observe(batch).proprio.view(2, 4)
    torch.testing.assert_close(proprio[:, :3], torch.tensor([[1.0, 1.0, 0.75], [0.0, 0.25, 0.0]]))


def test_training_without_labels_is_refused(tiny, make_batch):
    batch = make_batch()
    del batch[ACTION]
    with pytest.raises(DatasetError, match=ACTION):
        PerAct2Policy(PerAct2Config(**tiny))(batch)


def test_outer_autocast_does_not_touch_the_geometry(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch()
    expected = policy.observe(batch).points
    seen = []
    policy.predict = lambda observation, target: (
        seen.append(observation) or PerAct2Policy.predict(policy, observation, target)
    )
    with torch.autocast("cpu", torch.bfloat16):
        policy.eval()(batch)
    assert torch.equal(seen[0].points, expected)


def test_errors_are_the_distances_that_were_put_in(random_keyposes):
    keyposes = random_keyposes(4)
    per_arm = keyposes.view(4, 2, 9).clone()
    per_arm[:, 0, 0] += 0.03
    per_arm[:2, 1, 2] -= 0.08
    half = math.radians(10) / 2
    per_arm[:, 0, 3:7] = torch.tensor([math.cos(half), 0.0, 0.0, math.sin(half)])
    truth = keyposes.view(4, 2, 9).clone()
    truth[:, 0, 3:7] = torch.tensor([1.0, 0.0, 0.0, 0.0])
    found = keypose_errors(per_arm.flatten(1), truth.flatten(1))
    expected = {"left_position_cm": 3.0, "left_rotation_deg": 10.0, "left_far": 0.0}
    expected |= {"right_position_cm": 4.0, "right_rotation_deg": 0.0, "right_far": 0.5}
    assert {name: value.item() for name, value in found.items()} == pytest.approx(expected, abs=1e-2)


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


def test_equal_sentences_give_equal_tokens_whatever_their_neighbours():
    language = LearnedLanguage(tokens=5, dim=7).eval()
    alone = language(["lift the ball"])
    together = language(["push the very heavy box over to the red area", "lift the ball"])
    assert alone.shape == (1, 5, 7)
    torch.testing.assert_close(together[1], alone[0])


def test_word_slots_are_stable_and_other_words_give_other_tokens():
    language = LearnedLanguage(tokens=5, dim=7).eval()
    tokens = language(["press the red button", "press the blue button", "button red the press"])
    assert not torch.allclose(tokens[0], tokens[1])
    assert not torch.allclose(tokens[0], tokens[2])
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
