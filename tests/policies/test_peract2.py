"""PerAct2 keeps LeRobot's contract of a policy."""

import copy

import pytest
import torch
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.policies.factory import get_policy_class, make_pre_post_processors

from lerobot_bimanual.dataset.schema import NEXT_KEYPOSE, depth_key
from lerobot_bimanual.errors import SchemaMismatch
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_policy_bimanual import PerAct2Config
from lerobot_policy_bimanual.peract2.modeling_peract2 import PerAct2Policy

HEADS = pytest.mark.parametrize("head", ["dense", "factorised"])


def observation_only(batch: dict) -> dict:
    return {key: value for key, value in batch.items() if key not in (NEXT_KEYPOSE, "action")}


def part(batch: dict, sample: int) -> dict:
    return {key: value[sample : sample + 1] for key, value in batch.items()}


def assert_equal_batches(a: dict, b: dict) -> None:
    assert a.keys() == b.keys()
    for key, value in a.items():
        assert torch.equal(value, b[key]) if isinstance(value, torch.Tensor) else value == b[key]


def test_lerobot_finds_the_policy_by_its_type():
    assert get_policy_class("peract2") is PerAct2Policy


@HEADS
@pytest.mark.parametrize("decode", ["voxel", "expectation"])
def test_action_is_a_valid_keypose_of_both_arms(tiny, make_batch, head, decode):
    policy = PerAct2Policy(PerAct2Config(**tiny, translation_head=head, decode=decode))
    with torch.inference_mode():
        action = policy.select_action(make_batch(samples=3))
    assert action.shape == (3, 18)
    for vector in action.numpy():
        keypose = BimanualKeypose.from_vector(vector)
        for target in (keypose.left, keypose.right):
            assert policy.config.workspace.contains(target.pose.position)


@HEADS
def test_labels_and_recorded_actions_do_not_change_the_action(tiny, make_batch, head):
    policy = PerAct2Policy(PerAct2Config(**tiny, translation_head=head))
    batch = make_batch()
    action = policy.select_action(observation_only(batch))
    batch[NEXT_KEYPOSE] = batch[NEXT_KEYPOSE].flip(0)
    assert torch.equal(policy.select_action(batch), action)
    assert torch.equal(policy.predict_action_chunk(batch)[:, 0], action)


@HEADS
def test_a_batch_gives_the_actions_of_its_samples(tiny, make_batch, head):
    policy = PerAct2Policy(PerAct2Config(**tiny, translation_head=head, decode="expectation")).eval()
    batch = make_batch(samples=3)
    alone = torch.cat([policy.select_action(part(batch, sample)) for sample in range(3)])
    torch.testing.assert_close(policy.select_action(batch), alone)
    loss = policy(batch)[0]
    losses = [policy(part(batch, sample))[0] for sample in range(3)]
    torch.testing.assert_close(loss, torch.stack(losses).mean())


@HEADS
def test_gradients_reach_every_parameter(tiny, make_batch, head):
    policy = PerAct2Policy(PerAct2Config(**tiny, translation_head=head)).train()
    policy(make_batch(samples=4))[0].backward()
    for name, parameter in policy.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.any(), name


@HEADS
def test_neither_training_nor_acting_changes_the_batch(tiny, make_batch, head):
    policy = PerAct2Policy(PerAct2Config(**tiny, translation_head=head))
    batch = make_batch()
    before = copy.deepcopy(batch)
    policy.train()(batch)
    policy.select_action(batch)
    assert_equal_batches(batch, before)


def test_report_holds_plain_numbers_and_adds_up_to_the_loss(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny)).train()
    loss, report = policy(make_batch())
    assert all(type(value) is float for value in report.values())
    parts = sum(value for name, value in report.items() if name.endswith("_loss"))
    assert loss.item() == pytest.approx(parts, rel=1e-5)
    assert {"left_position_cm", "right_rotation_deg", "left_far"} <= report.keys()


@HEADS
def test_policy_survives_saving_and_ignores_the_environments_action_space(tiny, make_batch, head, tmp_path):
    policy = PerAct2Policy(PerAct2Config(**tiny, translation_head=head)).eval()
    policy.save_pretrained(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"config.json", "model.safetensors"}
    config = PerAct2Config.from_pretrained(tmp_path)
    config.output_features = {"action": PolicyFeature(FeatureType.ACTION, (16,))}
    restored = PerAct2Policy.from_pretrained(tmp_path, config=config, strict=True)
    batch = make_batch()
    assert torch.equal(restored.select_action(batch), policy.select_action(batch))
    assert torch.equal(restored(batch)[0], policy(batch)[0])


@pytest.mark.parametrize("cameras", [("front",), ("right_wrist", "left_shoulder")])
def test_only_the_chosen_cameras_are_looked_at(tiny, make_batch, cameras):
    policy = PerAct2Policy(PerAct2Config(**tiny, cameras=cameras)).eval()
    batch = make_batch()
    loss = policy(batch)[0]
    for camera in ("front", "left_shoulder", "right_shoulder", "left_wrist", "right_wrist"):
        if camera not in cameras:
            del batch[depth_key(camera)]
    assert torch.equal(policy(batch)[0], loss)


def test_images_of_any_size_are_accepted(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny, cameras=("front", "left_wrist")))
    small, large = make_batch(size=8), make_batch(size=24)
    mixed = {key: large[key] if "left_wrist" in key else value for key, value in small.items()}
    for batch in (small, large, mixed):
        assert policy.select_action(batch).shape == (2, 18)


def test_time_runs_from_one_to_minus_one_over_the_horizon(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny, keypose_horizon=5))
    batch = make_batch(samples=4)
    batch["observation.keypose_step"] = torch.tensor([[0.0], [2.0], [4.0], [9.0]])
    proprio = policy._observe(batch, None).proprio.view(4, 2, 4)
    assert proprio[:, :, 3].tolist() == [[1.0] * 2, [0.0] * 2, [-1.0] * 2, [-1.0] * 2]


def test_keypose_step_may_come_without_its_last_axis_as_lerobots_loader_gives_it(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch(samples=3)
    expected = policy._observe(batch, None).proprio
    batch["observation.keypose_step"] = batch["observation.keypose_step"].squeeze(1)
    assert torch.equal(policy._observe(batch, None).proprio, expected)


def test_proprioception_is_per_arm_and_left_first(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch(samples=1)
    batch["observation.state"] = torch.zeros(1, 16)
    batch["observation.state"][0, 7] = 1.0
    batch["observation.gripper_fingers"] = torch.tensor([[0.04, 0.03, 0.01, 0.0]])
    proprio = policy._observe(batch, None).proprio.view(2, 4)
    torch.testing.assert_close(proprio[:, :3], torch.tensor([[1.0, 1.0, 0.75], [0.0, 0.25, 0.0]]))


def test_depth_in_metres_is_refused(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch()
    batch[depth_key("front")] /= 1000
    with pytest.raises(SchemaMismatch, match="millimetres"):
        policy.select_action(batch)


def test_training_without_labels_is_refused(tiny, make_batch):
    with pytest.raises(SchemaMismatch, match=NEXT_KEYPOSE):
        PerAct2Policy(PerAct2Config(**tiny))(observation_only(make_batch()))


def test_evaluation_loss_is_not_augmented(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch()
    assert torch.equal(policy.eval()(batch)[0], policy.eval()(batch)[0])
    assert not torch.equal(policy.train()(batch)[0], policy.train()(batch)[0])


def test_outer_autocast_does_not_touch_the_geometry(tiny, make_batch):
    policy = PerAct2Policy(PerAct2Config(**tiny))
    batch = make_batch()
    expected = policy._observe(batch, None).points
    seen = []
    policy.predict = lambda observation, target: (
        seen.append(observation) or PerAct2Policy.predict(policy, observation, target)
    )
    with torch.autocast("cpu", torch.bfloat16):
        policy.eval()(batch)
    assert torch.equal(seen[0].points, expected)


def test_processors_leave_observations_alone_and_survive_saving(tiny, make_batch, tmp_path):
    config = PerAct2Config(**tiny)
    config.output_features = {"action": PolicyFeature(FeatureType.ACTION, (16,))}
    pre, post = make_pre_post_processors(config)
    pre.save_pretrained(tmp_path)
    post.save_pretrained(tmp_path)
    batch, keypose = make_batch(), torch.rand(2, 18)
    for preprocess, postprocess in (
        (pre, post),
        make_pre_post_processors(config, pretrained_path=str(tmp_path)),
    ):
        processed = preprocess(dict(batch))
        for key, value in batch.items():
            same = (
                torch.equal(processed[key], value)
                if isinstance(value, torch.Tensor)
                else processed[key] == value
            )
            assert same, key
        assert torch.equal(postprocess(keypose), keypose)


@pytest.mark.parametrize("head", [pytest.param("dense", marks=pytest.mark.slow), "factorised"])
def test_four_keyframes_are_learned_by_heart(tiny, make_batch, head):
    policy = PerAct2Policy(PerAct2Config(**tiny, translation_head=head, augmentation=False)).train()
    batch = make_batch(samples=4)
    optimizer = torch.optim.AdamW(policy.get_optim_params(), lr=5e-3)
    for _ in range(100):
        loss, _ = policy(batch)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 5.0)
        optimizer.step()
        if loss < 0.05:
            break
    assert loss < 0.05
    predicted, truth = (
        policy.codec.encode(policy.select_action(batch)),
        policy.codec.encode(batch[NEXT_KEYPOSE]),
    )
    assert (predicted.voxel - truth.voxel).abs().max() <= 1
    turn = (predicted.rotation - truth.rotation).abs() % 72
    assert torch.minimum(turn, 72 - turn).max() <= 1
    assert torch.equal(predicted.gripper_open, truth.gripper_open)
    assert torch.equal(predicted.ignore_collisions, truth.ignore_collisions)


@pytest.mark.slow
def test_compiling_does_not_change_the_names_in_the_checkpoint(tiny):
    plain, compiled = (PerAct2Policy(PerAct2Config(**tiny, compile=flag)) for flag in (False, True))
    assert plain.state_dict().keys() == compiled.state_dict().keys()
