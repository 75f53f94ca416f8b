"""The follower is told what the leader is going to do; independent arms are told nothing."""

import pytest
import torch

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_bimanual.dataset.schema import ACTION, GRIPPER_FINGERS
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.nn.arms import LeaderFollower
from lerobot_policy_bimanual.peract_independent.configuration_peract_independent import (
    PerActIndependentConfig,
)
from lerobot_policy_bimanual.peract_independent.modeling_peract_independent import PerActIndependentPolicy


@pytest.fixture(params=ARMS)
def leader(request):
    return request.param


@pytest.fixture
def policy(make_leader_follower, leader):
    return make_leader_follower(leader=str(leader), augmentation=False)


def parts(policy: KeyposePolicy) -> LeaderFollower:
    (network,) = [module for module in policy.modules() if isinstance(module, LeaderFollower)]
    return network


def spy(policy: KeyposePolicy) -> dict[str, torch.Tensor]:
    """The proprioception that each network was last called with."""
    seen = {}
    for name in ("leader", "follower"):
        network = getattr(parts(policy), name)
        network.register_forward_pre_hook(lambda _, inputs, name=name: seen.update({name: inputs[1]}))
    return seen


def numbers(policy: KeyposePolicy, bins: KeyposeBins, arm) -> torch.Tensor:
    """What the follower should be told of an arm's bins: where in the workspace, which angles, which flags."""
    position = policy.codec.decode(bins).view(-1, 2, 9)[:, arm.ordinal, :3]
    lower, upper = torch.tensor(policy.config.workspace_lower), torch.tensor(policy.config.workspace_upper)
    angles_deg = bins.rotation[:, arm.ordinal] * policy.config.rotation_bin_deg - 180
    flags = torch.stack([bins.gripper_open, bins.ignore_collisions], dim=-1)[:, arm.ordinal]
    return torch.cat([2 * (position - lower) / (upper - lower) - 1, angles_deg / 180, 2 * flags - 1], dim=-1)


@pytest.mark.parametrize("shift_m", [(0.0, 0.0, 0.0), (0.05, -0.05, 0.05)])
def test_training_tells_the_moved_label(make_leader_follower, leader, make_batch, monkeypatch, shift_m):
    policy = make_leader_follower(leader=str(leader), augmentation=True).train()
    motion = torch.eye(4).repeat(4, 1, 1)
    motion[:, :3, 3] = torch.tensor(shift_m)
    monkeypatch.setattr(f"{KeyposePolicy.__module__}.sample_motions", lambda keyposes, config: motion)
    seen, batch = spy(policy), make_batch(samples=4)
    policy(batch)
    assert seen["follower"].shape == (4, 4 + 8)
    moved = batch[ACTION].view(-1, 2, 9).clone()
    moved[..., :3] += torch.tensor(shift_m)
    label = policy.codec.encode(moved.flatten(1))
    torch.testing.assert_close(seen["follower"][:, 4:], numbers(policy, label, leader))
    assert seen["follower"][:, 4:].abs().max() <= 1


def test_when_acting_the_follower_is_told_the_prediction_of_the_leader(policy, leader, make_batch):
    seen, batch = spy(policy), make_batch(samples=4)
    best = policy.predict(policy.observe(batch), None).best()
    torch.testing.assert_close(seen["follower"][:, 4:], numbers(policy, best, leader))
    assert torch.equal(policy.select_action(batch), policy.codec.decode(best))


def test_predictions_come_left_arm_first(policy, leader, make_batch):
    network, outputs = parts(policy), {}
    network.leader.register_forward_hook(lambda _, inputs, output: outputs.update({leader: output}))
    network.follower.register_forward_hook(lambda _, inputs, output: outputs.update({leader.other: output}))
    prediction = policy.predict(policy.observe(make_batch()), None)
    for arm in ARMS:
        one = slice(arm.ordinal, arm.ordinal + 1)
        assert torch.equal(prediction.rotation[:, one], outputs[arm].rotation)
        assert torch.equal(prediction.gripper_open[:, one], outputs[arm].gripper_open)
        assert torch.equal(prediction.ignore_collisions[:, one], outputs[arm].ignore_collisions)
        assert torch.equal(prediction.best().voxel[:, one], outputs[arm].best().voxel)


def test_the_follower_heeds_the_leader_and_not_the_other_way_round(policy, leader, make_batch):
    policy.eval()
    batch = make_batch()
    observation, bins = policy.observe(batch), policy.target_bins(batch[ACTION])

    def turned(arm) -> KeyposeBins:
        rotation = bins.rotation.clone()
        rotation[:, arm.ordinal] = (rotation[:, arm.ordinal] + 20) % policy.codec.rotation_bins
        return KeyposeBins(bins.voxel, rotation, bins.gripper_open, bins.ignore_collisions)

    before = policy.predict(observation, bins).rotation
    after = policy.predict(observation, turned(leader)).rotation
    assert torch.equal(after[:, leader.ordinal], before[:, leader.ordinal])
    assert not torch.allclose(after[:, leader.other.ordinal], before[:, leader.other.ordinal])
    assert torch.equal(policy.predict(observation, turned(leader.other)).rotation, before)


def test_the_followers_loss_does_not_reach_the_leader(policy, leader, make_batch):
    batch = make_batch()
    target = policy.target_bins(batch[ACTION])
    prediction = policy.predict(policy.observe(batch), target)
    follower = leader.other.ordinal
    loss = prediction.translation.cross_entropy(target.voxel)[:, follower].sum()
    (loss + prediction.rotation[:, follower].logsumexp(-1).sum()).backward()
    network = parts(policy)
    assert all(value.grad is None or not value.grad.any() for value in network.leader.parameters())
    assert any(value.grad is not None and value.grad.any() for value in network.follower.parameters())


def test_independent_arms_ignore_each_others_fingers_and_labels(tiny, make_batch):
    policy = PerActIndependentPolicy(PerActIndependentConfig(**tiny, translation_head="factorised")).eval()
    batch = make_batch()
    target = policy.target_bins(batch[ACTION])
    before = policy.predict(policy.observe(batch), target)
    batch[GRIPPER_FINGERS][:, 2:] = 0.04 - batch[GRIPPER_FINGERS][:, 2:]
    other = KeyposeBins(*(torch.stack([x[:, 0], x[:, 1].flip(0)], dim=1) for x in vars(target).values()))
    after = policy.predict(policy.observe(batch), other)
    assert torch.equal(after.rotation[:, 0], before.rotation[:, 0])
    assert not torch.allclose(after.rotation[:, 1], before.rotation[:, 1])
    assert torch.equal(
        after.translation.cross_entropy(other.voxel)[:, 0],
        before.translation.cross_entropy(target.voxel)[:, 0],
    )
