"""Where two plans are equally good, arms that choose apart often disagree; an arm that sees the other's goal does not."""

from functools import partial

import pytest
import torch
from torch import Tensor, nn

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.codec_torch import KeyposeBins
from lerobot_policy_bimanual.nn.arms import IndependentArms, LeaderFollower
from lerobot_policy_bimanual.peract.network import PerActNetwork
from lerobot_policy_bimanual.peract.voxel_grid import GRID_CHANNELS, with_goal
from lerobot_policy_bimanual.peract2.configuration_peract2 import PerAct2Config
from lerobot_policy_bimanual.rvt_lf.views import VIEWS, pixels_of_voxels
from lerobot_policy_bimanual.rvt_lf.views import with_goal as views_with_goal

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
        prediction = network(grid, *inputs, KeyposeBins(voxel, torch.zeros_like(voxel), rest, rest))
        loss = prediction.translation.cross_entropy(voxel).sum(dim=1).mean()
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

    def follower(mark):
        return LeaderFollower(one_arm, proprio_dim=4, leader=Arm.RIGHT, codec=config.codec, mark=mark)

    apart = [
        trained(lambda: IndependentArms(one_arm, proprio_dim=4)),
        trained(lambda: PerActNetwork(config, arms=2, proprio_dim=8)),
    ]
    following, joint = (
        trained(lambda: follower(with_goal)),
        trained(lambda: PerActNetwork(config, arms=2, proprio_dim=8, joint=True)),
    )
    assert following > 0.95
    assert joint > 0.9 > max(apart)


@pytest.mark.parametrize("head", ["dense", "factorised"])
def test_with_joint_decoding_the_right_arms_position_follows_the_left_ones(tiny, head):
    config = PerAct2Config(**tiny | {"translation_head": head})
    network = PerActNetwork(config, arms=2, proprio_dim=8, joint=True).eval()
    grid, things = two_things(3, torch.Generator().manual_seed(0))
    rest = torch.zeros(3, 2, dtype=torch.long)

    def losses(voxel: Tensor) -> Tensor:
        """Of the same targets (3, arms), where the network is told these voxels."""
        target = KeyposeBins(voxel, torch.zeros_like(voxel), rest, rest)
        prediction = network(grid, torch.zeros(3, 8), torch.zeros(3, 4, config.language_dim), target)
        return prediction.translation.cross_entropy(voxel)

    moved_left = torch.stack([9 - things[:, 0], things[:, 1]], dim=1)
    assert not torch.isclose(losses(things)[:, 1], losses(moved_left)[:, 1]).any()
    moved_right = torch.stack([things[:, 0], 9 - things[:, 1]], dim=1)
    assert torch.equal(losses(things)[:, 0], losses(moved_right)[:, 0])


def test_the_goal_is_marked_where_it_lies_in_the_grid_and_is_seen_in_every_view():
    voxel = torch.tensor([[1, 2, 3], [9, 0, 4]])
    marked = with_goal(torch.zeros(2, GRID_CHANNELS, VOXELS, VOXELS, VOXELS), voxel)[:, GRID_CHANNELS]
    views = views_with_goal(torch.zeros(2, len(VIEWS), 4, VOXELS, VOXELS), voxel)[:, :, 4]
    rows, columns = pixels_of_voxels(voxel, VOXELS)
    for sample, (x, y, z) in enumerate(voxel):
        assert marked[sample].argmax() == (x * VOXELS + y) * VOXELS + z
        assert marked[sample, x, y, z] == 1
        assert (
            views[sample].flatten(1).argmax(1).tolist() == (rows[sample] * VOXELS + columns[sample]).tolist()
        )
