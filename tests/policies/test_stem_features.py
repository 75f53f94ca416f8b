"""Points become voxels, and what is read of the stem equals reading it from a map that is laid out."""

import peract2_written_out as reference
import pytest
import torch

from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_policy_bimanual.nn.layers import LEAK
from lerobot_policy_bimanual.peract.convolutions import PatchConv3d, PointwiseConv3d
from lerobot_policy_bimanual.peract.factorised_head import ProjectionConv2d
from lerobot_policy_bimanual.peract.stem_features import StemFeatures
from lerobot_policy_bimanual.peract.voxel_grid import voxelise

WIDTH = 15


@pytest.fixture
def layers() -> tuple[PointwiseConv3d, PatchConv3d]:
    stem, patchify = PointwiseConv3d(10, 4).double(), PatchConv3d(4, 6, centred=False).double()
    for layer in (stem, patchify):
        torch.nn.init.normal_(layer.conv.bias)
    return stem, patchify


def cut_out(stem: torch.Tensor, place: torch.Tensor) -> torch.Tensor:
    """Patches (b, arms, n, 3) of a map with one voxel around them."""
    padded = torch.nn.functional.pad(stem, (1,) * 6)
    rows = [
        [[padded[b, :, x : x + 7, y : y + 7, z : z + 7] for x, y, z in arm] for arm in sample]
        for b, sample in enumerate((5 * place).tolist())
    ]
    return torch.stack([torch.stack([torch.stack(arm) for arm in sample]) for sample in rows])


@pytest.mark.parametrize("filtered", [False, True])
def test_tokens_projections_and_crops_are_those_of_the_map_with_gradients(layers, filtered):
    stem, patchify = layers
    grid = torch.randn(2, 10, *[WIDTH] * 3, dtype=torch.float64)
    place = torch.tensor([[[0, 1, 2]], [[2, 2, 0]]])[:, None].expand(-1, 2, -1, -1)
    words = filtered * torch.randn(2, 4, 11, dtype=torch.float64)
    words.requires_grad_()

    weight, bias = stem.conv.weight.flatten(1) + words[..., :-1], stem.conv.bias + words[..., -1]
    features = torch.einsum("bixyz,boi->boxyz", grid, weight) + bias[..., None, None, None]
    features = torch.nn.functional.leaky_relu(features, LEAK)
    expected = [patchify(features), *(features.amax(axis) for axis in (2, 3, 4)), cut_out(features, place)]
    reading = StemFeatures(grid, stem, patchify, words if filtered else None)
    actual = [reading.tokens, *reading.planes, reading.crop(place)]
    parameters = [stem.conv.weight, stem.conv.bias, patchify.conv.weight, patchify.conv.bias]
    parameters += [words] * filtered
    probes = [torch.randn_like(each) for each in expected]
    actual += torch.autograd.grad(actual, parameters, probes)
    expected += torch.autograd.grad(expected, parameters, probes)
    for got, want in zip(actual, expected, strict=True):
        torch.testing.assert_close(got, want)


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_of_equal_voxels_the_first_one_of_a_line_gets_the_gradient(layers, dtype):
    stem, patchify = (layer.float() for layer in layers)
    grid = torch.zeros(1, 10, *[WIDTH] * 3)
    grid[0, 0, 7, 3, 2] = grid[0, 0, 12, 3, 2] = 1
    grid[0, 1, 7, 3, 2], grid[0, 1, 12, 3, 2] = 5, 50  # which one it is, as no output but the gradient tells
    with torch.no_grad():
        stem.conv.weight.zero_()[:, 0] = 1
    with torch.autocast("cpu", torch.bfloat16, enabled=dtype == torch.bfloat16):
        plane = StemFeatures(grid, stem, patchify).planes[0]
    plane[0, :, 3, 2].sum().backward()
    assert (stem.conv.weight.grad.flatten(1)[:, 1] / stem.conv.weight.grad.flatten(1)[:, 0] == 5).all()


@pytest.mark.parametrize(("dilations", "reach"), [((), 1), ((3,), 4), ((3, 9), 13)])
def test_a_projection_sees_every_place_as_far_as_its_dilations_add_up_to(dilations, reach):
    layer = ProjectionConv2d(1, 8, dilations).double()
    plane = torch.randn(1, 1, 31, 31, dtype=torch.float64, requires_grad=True)
    layer(plane)[0, :, 15, 15].sum().backward()
    away = (torch.arange(31) - 15).abs()
    seen = torch.maximum(away[:, None], away[None]) <= reach
    assert (plane.grad[0, 0] != 0).equal(seen)


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


def test_grid_and_codec_agree_on_the_voxel_of_a_point(random_keyposes):
    keyposes = random_keyposes(20)
    bins = TorchKeyposeCodec(voxels=50).encode(keyposes)
    for keypose, voxel in zip(keyposes, bins.voxel, strict=True):
        left = keypose[:3].view(1, 3, 1)
        grid = voxelise(left, torch.zeros_like(left), workspace=VOXEL_WORKSPACE, voxels=50)
        assert grid[0, 9].nonzero().tolist() == [voxel[0].tolist()]
