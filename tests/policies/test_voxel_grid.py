"""Points to voxels."""

import peract2_written_out as reference
import torch

from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE, Workspace
from lerobot_policy_bimanual.peract.voxel_grid import voxelise, with_quadratic_features


def random_cloud(samples: int = 2, points: int = 300) -> tuple[torch.Tensor, torch.Tensor]:
    """Points in and around the workspace, some of them invalid."""
    cloud = torch.rand(samples, 3, points, dtype=torch.float64) * 1.6 - 0.5
    cloud[:, 2] += 0.6
    cloud[:, :, ::17] = torch.nan
    return cloud, torch.rand(samples, 3, points, dtype=torch.float64) * 2 - 1


def test_grid_equals_averaging_point_by_point():
    points, colours = random_cloud()
    expected = reference.voxelise(
        points, colours, torch.tensor(VOXEL_WORKSPACE.lower), torch.tensor(VOXEL_WORKSPACE.upper), 5
    )
    actual = voxelise(points, colours, workspace=VOXEL_WORKSPACE, voxels=5)
    torch.testing.assert_close(actual, expected)


def test_points_outside_and_invalid_points_leave_the_grid_empty():
    outside = torch.tensor([[[-0.31, 0.7, torch.nan, torch.inf]] * 3])
    grid = voxelise(outside, torch.ones_like(outside), workspace=Workspace((-0.3,) * 3, (0.7,) * 3), voxels=5)
    assert not grid[:, :6].any()
    assert not grid[:, 9].any()
    assert torch.isfinite(grid).all()


def test_squares_of_colours_and_places_come_behind_the_grid():
    grid = torch.randn(2, 10, 3, 3, 3)
    squared = with_quadratic_features(grid)
    assert torch.equal(squared[:, :10], grid)
    assert torch.equal(squared[:, 10:13], grid[:, 3:6] ** 2)  # mean RGB
    assert torch.equal(squared[:, 13:], grid[:, 6:9] ** 2)  # voxel index / voxels


def test_grid_and_codec_agree_on_the_voxel_of_a_point(random_keyposes):
    keyposes = random_keyposes(20)
    bins = TorchKeyposeCodec(voxels=50).encode(keyposes)
    for keypose, voxel in zip(keyposes, bins.voxel, strict=True):
        left = keypose[:3].view(1, 3, 1)
        grid = voxelise(left, torch.zeros_like(left), workspace=VOXEL_WORKSPACE, voxels=50)
        assert grid[0, 9].nonzero().tolist() == [voxel[0].tolist()]
