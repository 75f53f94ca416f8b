"""Voxel grids of points, and stem features, which equal those computed from the whole feature map."""

import peract2_written_out as reference
import pytest
import torch
import torch.nn.functional as F  # noqa: N812

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


@pytest.mark.parametrize("filtered", [False, True])
def test_tokens_projections_and_crops_are_those_of_the_map_with_gradients(layers, filtered):
    stem, patchify = layers
    grid = torch.randn(2, 10, *[WIDTH] * 3, dtype=torch.float64)
    place = torch.randint(0, 3, (2, 2, 4, 3))
    words = filtered * torch.randn(2, 4, 11, dtype=torch.float64)
    words.requires_grad_()

    weight, bias = stem.conv.weight.flatten(1) + words[..., :-1], stem.conv.bias + words[..., -1]
    features = torch.einsum("bixyz,boi->boxyz", grid, weight) + bias[..., None, None, None]
    features = F.leaky_relu(features, LEAK)
    crops = F.pad(features, (1,) * 6).unfold(2, 7, 5).unfold(3, 7, 5).unfold(4, 7, 5).movedim(1, 4)
    crops = crops[torch.arange(2)[:, None, None], *place.unbind(-1)]  # of patches with one voxel around them
    expected = [patchify(features), *(features.amax(axis) for axis in (2, 3, 4)), crops]
    reading = StemFeatures(grid, stem, patchify, words if filtered else None)
    actual = [reading.tokens, *reading.planes, reading.crop(place)]
    parameters = [stem.conv.weight, stem.conv.bias, patchify.conv.weight, patchify.conv.bias]
    parameters += [words] * filtered
    probes = [torch.randn_like(each) for each in expected]
    actual += torch.autograd.grad(actual, parameters, probes)
    expected += torch.autograd.grad(expected, parameters, probes)
    torch.testing.assert_close(actual, expected)


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


def test_grid_equals_averaging_point_by_point():
    points = torch.rand(2, 3, 300, dtype=torch.float64) * 1.6 - 0.5  # in and around the workspace
    points[:, 2] += 0.6
    points[:, :, ::17] = torch.nan
    colours = torch.rand(2, 3, 300, dtype=torch.float64) * 2 - 1
    lower, upper = torch.tensor(VOXEL_WORKSPACE.lower), torch.tensor(VOXEL_WORKSPACE.upper)
    expected = reference.voxelise(points, colours, lower, upper, 5)
    torch.testing.assert_close(voxelise(points, colours, workspace=VOXEL_WORKSPACE, voxels=5), expected)


def test_grid_and_codec_agree_on_the_voxel_of_a_point(random_keyposes):
    keyposes = random_keyposes(20)
    left = keyposes[:, :3, None]
    grid = voxelise(left, torch.zeros_like(left), workspace=VOXEL_WORKSPACE, voxels=25)
    assert grid[:, 9].nonzero()[:, 1:].equal(TorchKeyposeCodec(voxels=25).encode(keyposes).voxel[:, 0])
