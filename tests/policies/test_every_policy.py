"""Every registered keypose policy keeps LeRobot's contract of a policy."""

import copy
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from huggingface_hub import ModelCard
from lerobot.configs import FeatureType, PolicyFeature, PreTrainedConfig, policies
from lerobot.policies.factory import get_policy_class
from torch.nn import functional

import lerobot_policy_bimanual
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.schema import ACTION, KEYPOSE_STEP, depth_key, image_key
from lerobot_bimanual.errors import BimanualError, DatasetError, InvalidChoice
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual import evaluate
from lerobot_policy_bimanual import PerAct2Config, PerAct2Policy
from lerobot_policy_bimanual.errors import BadConfig
from lerobot_policy_bimanual.keypose.config import KeyposePolicyConfig


def part(batch: dict, sample: int) -> dict:
    return {key: value[sample : sample + 1] for key, value in batch.items()}


def assert_equal_batches(a: dict, b: dict) -> None:
    assert a.keys() == b.keys()
    for key, value in a.items():
        assert torch.equal(value, b[key]) if isinstance(value, torch.Tensor) else value == b[key]


def test_every_registered_keypose_policy_is_walked_by_these_tests(specimens):
    known = PreTrainedConfig.get_known_choices().items()
    assert specimens.keys() == {name for name, config in known if issubclass(config, KeyposePolicyConfig)}


def test_the_package_offers_the_config_and_the_policy_of_every_type(policy_type):
    offered = {name: getattr(lerobot_policy_bimanual, name) for name in lerobot_policy_bimanual.__all__}
    for kind in (PreTrainedConfig.get_choice_class(policy_type), get_policy_class(policy_type)):
        assert offered[kind.__name__] is kind


def test_a_policy_without_its_preprocessor_is_not_evaluated_as_a_callable():
    with pytest.raises(BimanualError, match="score its checkpoint with `lerobot-eval`"):
        evaluate(object.__new__(PerAct2Policy), "lift_ball")


def test_the_card_on_the_hub_has_the_command_that_scores_the_policy(make_policy, monkeypatch):
    monkeypatch.setattr(ModelCard, "validate", lambda card: None)  # it is the Hub that validates
    policy = make_policy(repo_id="me/mine")
    policy.config.input_features = {
        image_key(camera): PolicyFeature(FeatureType.VISUAL, (3, 96, 128)) for camera in CAMERA_NAMES
    }
    card = policy.generate_model_card("me/data", policy.config.type, None, None)
    flags = "--policy.path=me/mine --env.type=bimanual --env.task=TASK --env.image_size=96x128"
    assert str(card).count(flags) == 1


def test_defaults_have_the_reference_implementations_parameter_count(policy_type, specimens):
    config = PreTrainedConfig.get_choice_class(policy_type)(device="cpu")
    with torch.device("meta"):
        policy = get_policy_class(policy_type)(config)
    count = sum(each.numel() for name, each in policy.named_parameters() if not name.startswith("language."))
    assert count == specimens[policy_type].parameters


@pytest.mark.parametrize("decode", ["voxel", "expectation"])
def test_action_is_a_valid_keypose_of_both_arms(make_policy, make_batch, decode):
    policy = make_policy(decode=decode)
    with torch.inference_mode():
        action = policy.select_action(make_batch(samples=3))
    assert action.shape == (3, 18)
    for vector in action.numpy():
        keypose = BimanualKeypose.from_vector(vector)
        for target in (keypose.left, keypose.right):
            assert policy.config.workspace.contains(target.pose.position)


def test_labels_are_needed_to_learn_and_do_not_change_the_action(make_policy, make_batch):
    policy = make_policy()
    batch = make_batch()
    observation = {key: value for key, value in batch.items() if key != ACTION}
    action = policy.select_action(observation)
    with pytest.raises(DatasetError, match=ACTION):
        policy(observation)
    batch[ACTION] = batch[ACTION].flip(0)
    assert torch.equal(policy.select_action(batch), action)
    assert torch.equal(policy.predict_action_chunk(batch)[:, 0], action)


def test_a_batch_gives_the_actions_of_its_samples(make_policy, make_batch):
    policy = make_policy(decode="expectation").eval()
    batch = make_batch(samples=3)
    alone = torch.cat([policy.select_action(part(batch, sample)) for sample in range(3)])
    torch.testing.assert_close(policy.select_action(batch), alone)
    loss = policy(batch)[0]
    losses, report = policy(batch, reduction="none")
    torch.testing.assert_close(losses, torch.stack([policy(part(batch, each))[0] for each in range(3)]))
    torch.testing.assert_close(loss, losses.mean())
    assert report == policy(batch)[1]
    with pytest.raises(InvalidChoice, match="mean, none"):
        policy(batch, reduction="sum")


@pytest.mark.parametrize("dtype", ["float32", "bfloat16"])
def test_gradients_reach_every_parameter(make_policy, make_batch, dtype):
    policy = make_policy(dtype=dtype).train()
    policy(make_batch(samples=4))[0].backward()
    for name, parameter in policy.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
        if re.search(r"patch_(logits|lines)\.\d\.bias$", name):
            # Adding one number to the logits of all patches changes no softmax: what reaches these is rounding.
            assert parameter.grad.abs() < {"float32": 1e-5, "bfloat16": 0.05}[dtype], name
        else:
            assert parameter.grad.any(), name


def test_linear_layers_are_linear_so_that_adapters_can_be_merged(make_policy, make_batch):
    def check(layer: torch.nn.Linear, inputs: tuple[torch.Tensor], output: torch.Tensor) -> None:
        torch.testing.assert_close(output, functional.linear(inputs[0], layer.weight, layer.bias))

    policy = make_policy()
    layers = [module for module in policy.modules() if isinstance(module, torch.nn.Linear)]
    for layer in layers:
        layer.register_forward_hook(check)
    policy(make_batch())
    assert layers


def test_bfloat16_gives_nearly_the_same_loss(make_policy, make_batch):
    full, half = make_policy().eval(), make_policy(dtype="bfloat16").eval()
    half.load_state_dict(full.state_dict())
    batch = make_batch()
    loss = half(batch)[0]
    assert loss.dtype == torch.float32
    assert loss != full(batch)[0]
    torch.testing.assert_close(loss, full(batch)[0], atol=0, rtol=0.02)


def test_a_batch_stays_as_it_is_and_only_the_training_loss_is_augmented(make_policy, make_batch):
    policy = make_policy()
    batch = make_batch()
    before = copy.deepcopy(batch)
    policy.train()(batch)
    policy.select_action(batch)
    assert_equal_batches(batch, before)
    assert torch.equal(policy.eval()(batch)[0], policy.eval()(batch)[0])
    assert not torch.equal(policy.train()(batch)[0], policy.train()(batch)[0])


def test_policy_survives_saving_whatever_the_environments_action(make_policy, make_batch, tmp_path):
    policy = make_policy().eval()
    policy.save_pretrained(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"config.json", "model.safetensors"}
    config = PreTrainedConfig.from_pretrained(tmp_path)
    assert config == policy.config
    assert config.output_features == {"action": PolicyFeature(FeatureType.ACTION, (18,))}
    config.output_features = {"action": PolicyFeature(FeatureType.ACTION, (16,))}
    restored = type(policy).from_pretrained(tmp_path, config=config, strict=True)
    batch = make_batch()
    assert torch.equal(restored.select_action(batch), policy.select_action(batch))
    assert torch.equal(restored(batch)[0], policy(batch)[0])
    assert restored.config.output_features == policy.config.output_features


def test_only_the_chosen_cameras_are_looked_at(make_policy, make_batch):
    cameras = ("right_wrist", "left_shoulder")
    policy = make_policy(cameras=cameras).eval()
    batch = make_batch()
    loss = policy(batch)[0]
    for camera in CAMERA_NAMES:
        if camera not in cameras:
            del batch[depth_key(camera)]
    assert torch.equal(policy(batch)[0], loss)


def test_flags_must_not_contradict_a_checkpoint_and_long_datasets_warn(
    make_policy, tmp_path, caplog, monkeypatch
):
    stats = {KEYPOSE_STEP: {"max": np.array([5.0])}}
    policy = make_policy(dataset_stats=stats, keypose_horizon=None)
    policy.save_pretrained(tmp_path)
    config = PreTrainedConfig.from_pretrained(tmp_path)
    listed = replace(config, workspace_lower=list(config.workspace_lower))
    assert type(policy).from_pretrained(tmp_path, config=listed).config.workspace_lower
    others = {"keypose_horizon": 7, "workspace_lower": (0.0, 0.0, 0.0), "heads": 1}
    if policy.name == "rvt_lf":
        others |= {"heatmap_fusion": "product"} if config.fine_stage_zoom == 1 else {"fine_stage_zoom": 3}
    for name, other in others.items():
        with pytest.raises(BadConfig, match=rf"leave out --policy\.{name}"):
            type(policy).from_pretrained(tmp_path, config=replace(config, **{name: other}))
    monkeypatch.setattr(policies, "hf_hub_download", lambda **kwargs: tmp_path / "config.json")
    with pytest.raises(BadConfig, match=r"me/model was trained with .*--policy\.heads"):
        type(policy).from_pretrained("me/model", config=replace(config, heads=1))
    labels = {"min": -np.ones(18), "max": np.ones(18)}
    longer = {KEYPOSE_STEP: {"max": np.array([6.0])}, ACTION: labels}
    restored = type(policy).from_pretrained(tmp_path, config=config, dataset_stats=longer)
    assert restored.config.keypose_horizon == 6
    steps, workspace = caplog.messages
    assert "episodes of 6 keyposes" in steps
    assert "beyond the workspace" in workspace


def test_a_policy_that_does_not_use_the_keypose_step_ignores_it(make_policy, make_batch):
    policy = make_policy(use_keypose_step=False, keypose_horizon=None)
    told = make_batch()
    action = policy.select_action({key: value for key, value in told.items() if key != KEYPOSE_STEP})
    for step in (0, 7):
        told[KEYPOSE_STEP] = torch.full((2, 1), float(step))
        assert torch.equal(policy.select_action(told), action)


@pytest.mark.slow
def test_four_keyframes_are_learned_by_heart(make_policy, make_batch, monkeypatch):
    # The same views in every step.
    monkeypatch.setattr("lerobot_policy_bimanual.rvt_lf.two_stages.JITTER", 0.0)
    policy = make_policy(augmentation=False).train()
    batch = make_batch(samples=4)
    optimizer = torch.optim.AdamW(policy.get_optim_params(), lr=5e-3)
    # At a constant rate the loss of RVT-LF goes up and down about the limit, on each processor differently.
    schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1, 0.3, total_iters=600)
    for _ in range(600):
        loss, _ = policy(batch)
        # Before the step: one more can raise the loss a hundredfold at this rate.
        if loss < 0.01:
            break
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 5.0)
        optimizer.step()
        schedule.step()
    assert loss < 0.01
    predicted = policy.codec.encode(policy.select_action(batch))
    truth = policy.codec.encode(batch[ACTION])
    assert (predicted.voxel - truth.voxel).abs().max() <= 1
    turn = (predicted.rotation - truth.rotation).abs() % 72
    assert torch.minimum(turn, 72 - turn).max() <= 1
    assert torch.equal(predicted.gripper_open, truth.gripper_open)
    assert torch.equal(predicted.ignore_collisions, truth.ignore_collisions)


@pytest.mark.weekly
def test_a_compiled_network_has_the_plain_losses_and_is_compiled_once(specimens, make_batch, monkeypatch):
    graphs = []

    def backend(graph: torch.fx.GraphModule, inputs: list) -> Callable:
        """Dynamo and autograd's tracing without the compiler of the machine."""
        graphs.append(graph)
        return torch._dynamo.lookup_backend("aot_eager")(graph, inputs)

    compiler = torch.nn.Module.compile
    monkeypatch.setattr(torch.nn.Module, "compile", lambda module: compiler(module, backend=backend))
    options = specimens["peract2"].tiny["factorised"] | {"augmentation": False}
    plain, compiled = (PerAct2Policy(PerAct2Config(**options, compile=on)).train() for on in (False, True))
    compiled.load_state_dict(plain.state_dict())
    batch = make_batch()
    for _ in range(2):
        once = len(graphs)
        expected, loss = plain(batch)[0], compiled(batch)[0]
        torch.testing.assert_close(loss, expected)
        pairs = ((expected, plain), (loss, compiled))
        gradients = [torch.autograd.grad(value, policy.network.positions)[0] for value, policy in pairs]
        torch.testing.assert_close(*gradients, atol=1e-4, rtol=1e-3)
    assert once == len(graphs) > 0
