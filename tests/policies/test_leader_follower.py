"""The follower is told what the leader is going to do; independent arms are told nothing, and disagree on two equal plans."""

from dataclasses import replace
from functools import partial

import pytest
import torch
from torch import Tensor, nn

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_bimanual.dataset.schema import ACTION, GRIPPER_FINGERS
from lerobot_policy_bimanual import PerAct2Config, PerActIndependentConfig, PerActIndependentPolicy
from lerobot_policy_bimanual.keypose.policy import KeyposePolicy
from lerobot_policy_bimanual.nn.arms import IndependentArms, LeaderFollower
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.voxel_grid import GRID_CHANNELS, with_goal
from lerobot_policy_bimanual.rvt_lf.views import VIEWS, pixels_of_voxels, with_mark


@pytest.fixture(params=ARMS)
def leader(request):
    return request.param


@pytest.fixture
def policy(make_leader_follower, leader):
    return make_leader_follower(leader=str(leader), augmentation=False)


def told_to_follower(policy: KeyposePolicy) -> list[Tensor]:
    """What the follower is told beside its own proprioception, (b, 8) for each call to come."""
    told = []
    policy.network.follower.register_forward_pre_hook(lambda _, inputs: told.append(inputs[1][:, 4:]))
    return told


def numbers(policy: KeyposePolicy, bins: KeyposeBins, arm) -> Tensor:
    """What the follower should be told of an arm's bins: where in the workspace, which angles, which flags."""
    position = policy.codec.voxel_centers(bins.voxel_position)[:, arm.ordinal]
    lower, upper = torch.tensor(policy.config.workspace_lower), torch.tensor(policy.config.workspace_upper)
    angles_deg = bins.rotation[:, arm.ordinal] * policy.config.rotation_bin_deg - 180
    flags = torch.stack([bins.gripper_open, bins.ignore_collisions], dim=-1)[:, arm.ordinal]
    return torch.cat([2 * (position - lower) / (upper - lower) - 1, angles_deg / 180, 2 * flags - 1], dim=-1)


def test_in_training_the_follower_is_told_the_leaders_augmented_label(
    make_leader_follower, leader, make_batch, monkeypatch
):
    policy = make_leader_follower(leader=str(leader), augmentation=True).train()
    motion, shift_m = torch.eye(4).repeat(4, 1, 1), torch.tensor([0.05, -0.05, 0.05])
    motion[:, :3, 3] = shift_m
    monkeypatch.setattr(f"{KeyposePolicy.__module__}.sample_motions", lambda keyposes, config: motion)
    told, batch = told_to_follower(policy), make_batch(samples=4)
    policy(batch)
    moved = batch[ACTION].view(-1, 2, 9).clone()
    moved[..., :3] += shift_m
    label = policy.codec.encode(moved.flatten(1))
    torch.testing.assert_close(told[0], numbers(policy, label, leader))
    assert told[0].abs().max() <= 1


@pytest.mark.parametrize("dtype", ["float32", "bfloat16"])
def test_when_acting_the_follower_is_told_the_prediction_of_the_leader(policy, leader, make_batch, dtype):
    policy.config.dtype = dtype
    told, batch = told_to_follower(policy), make_batch(samples=4)
    best = policy.predict(policy.observe(batch), None).best()
    torch.testing.assert_close(told[0], numbers(policy, best, leader))
    assert torch.equal(policy.select_action(batch), policy.codec.decode(best))


def test_a_follower_cannot_tell_in_which_of_two_voxels_a_label_on_their_border_is(policy, make_batch):
    told, batch = told_to_follower(policy), make_batch()
    observation, target = policy.observe(batch), policy.target_bins(batch[ACTION])
    for side in (-1e-6, 1e-6):
        voxel_position = target.voxel + 0.5 + side
        policy.predict(
            observation, replace(target, voxel=voxel_position.round().long(), voxel_position=voxel_position)
        )
    torch.testing.assert_close(*told, atol=1e-5, rtol=0)


def test_the_follower_heeds_the_leader_and_not_the_other_way_round(policy, leader, make_batch):
    policy.eval()
    batch = make_batch()
    observation, bins = policy.observe(batch), policy.target_bins(batch[ACTION])

    def turned(arm) -> KeyposeBins:
        rotation = bins.rotation.clone()
        rotation[:, arm.ordinal] = (rotation[:, arm.ordinal] + 20) % policy.codec.rotation_bins
        return replace(bins, rotation=rotation)

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
    loss = prediction.translation.cross_entropy(target.voxel, torch.zeros(2, 2, 3))[:, follower].sum()
    (loss + prediction.rotation[:, follower].logsumexp(-1).sum()).backward()
    network = policy.network
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
    centre = torch.zeros(2, 2, 3)
    assert torch.equal(
        after.translation.cross_entropy(other.voxel, centre)[:, 0],
        before.translation.cross_entropy(target.voxel, centre)[:, 0],
    )


VOXELS = 10


def two_things(samples: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Grids (samples, 10, v, v, v) with two occupied voxels, and which they are, (samples, 2, 3)."""
    voxel = torch.randint(1, VOXELS - 1, (samples, 2, 3), generator=generator)
    grid = torch.zeros(samples, GRID_CHANNELS, VOXELS, VOXELS, VOXELS)
    axis = torch.arange(VOXELS) / VOXELS
    grid[:, 6:9] = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"))
    for x, y, z in voxel.permute(1, 2, 0):
        grid[torch.arange(samples), 9, x, y, z] = 1
    return grid, voxel


def agreement(network: nn.Module, dim: int) -> float:
    """Trains on demonstrations of two equal plans, and returns how often the arms choose different things of 64 scenes."""
    generator = torch.Generator().manual_seed(0)
    optimizer = torch.optim.Adam(network.parameters(), lr=5e-3)
    inputs = torch.zeros(16, 8), torch.zeros(16, 4, dim)
    for _ in range(200):
        grid, things = two_things(16, generator)
        swapped = torch.rand(16, 1, 1, generator=generator) < 0.5
        voxel = torch.where(swapped, things.flip(1), things)
        rest = torch.zeros(16, 2, dtype=torch.long)
        prediction = network(grid, *inputs, KeyposeBins(voxel, torch.zeros_like(voxel), rest, rest, voxel))
        loss = prediction.translation.cross_entropy(voxel, torch.zeros(16, 2, 3)).sum(dim=1).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    grid, things = two_things(64, generator)
    with torch.no_grad():
        best = network.eval()(grid, torch.zeros(64, 8), torch.zeros(64, 4, dim)).best().voxel
    plans = torch.stack([things, things.flip(1)])
    return (best == plans).all(dim=-1).all(dim=-1).any(dim=0).double().mean().item()


@pytest.mark.weekly
def test_arms_agree_on_one_of_two_plans_if_one_sees_the_goal_of_the_other(tiny):
    finer = {"projection_dilations": (2,), "quadratic_features": True, "voxel_cells": 3}
    config = PerAct2Config(**tiny | {"translation_head": "factorised"} | finer)
    one_arm = partial(PerActNetwork, config, arms=1)

    def trained(make) -> float:
        torch.manual_seed(0)
        return agreement(make(), config.language_dim)

    def follower_that_sees_the_goal() -> LeaderFollower:
        return LeaderFollower(one_arm, proprio_dim=4, leader=Arm.RIGHT, codec=config.codec, mark=with_goal)

    independent = trained(lambda: IndependentArms(one_arm, proprio_dim=4))
    together = trained(lambda: PerActNetwork(config, arms=2, proprio_dim=8))
    joint = trained(lambda: PerActNetwork(config, arms=2, proprio_dim=8, joint=True))
    assert trained(follower_that_sees_the_goal) > 0.95
    assert joint > 0.9 > max(independent, together)


@pytest.mark.parametrize("head", ["dense", "factorised"])
def test_with_joint_decoding_the_right_arms_position_follows_the_left_ones(tiny, head):
    config = PerAct2Config(**tiny | {"translation_head": head})
    network = PerActNetwork(config, arms=2, proprio_dim=8, joint=True).eval()
    grid, things = two_things(3, torch.Generator().manual_seed(0))
    rest = torch.zeros(3, 2, dtype=torch.long)

    def losses(voxel: Tensor) -> Tensor:
        """Cross-entropies (3, arms) of these voxels, which the network is told as well."""
        target = KeyposeBins(voxel, torch.zeros_like(voxel), rest, rest, voxel)
        prediction = network(grid, torch.zeros(3, 8), torch.zeros(3, 4, config.language_dim), target)
        return prediction.translation.cross_entropy(voxel, torch.zeros(3, 2, 3))

    moved_left = torch.stack([9 - things[:, 0], things[:, 1]], dim=1)
    assert not torch.isclose(losses(things)[:, 1], losses(moved_left)[:, 1]).any()
    moved_right = torch.stack([things[:, 0], 9 - things[:, 1]], dim=1)
    assert torch.equal(losses(things)[:, 0], losses(moved_right)[:, 0])


def test_the_goal_is_marked_where_it_lies_in_the_grid_and_is_seen_in_every_view():
    voxel = torch.tensor([[1, 2, 3], [9, 0, 4]])
    marked = with_goal(torch.zeros(2, GRID_CHANNELS, VOXELS, VOXELS, VOXELS), voxel)[:, GRID_CHANNELS]
    assert (marked == 1).nonzero()[:, 1:].equal(voxel)
    assert marked.max() == 1
    views = with_mark(torch.zeros(2, len(VIEWS), 4, VOXELS, VOXELS), voxel)[:, :, 4]
    rows, columns = pixels_of_voxels(voxel, VOXELS)
    assert views.flatten(2).argmax(2).equal(rows * VOXELS + columns)
