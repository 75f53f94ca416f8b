"""Rendered views show the cloud from five sides."""

import itertools

import pytest
import torch

from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_policy_bimanual.rvt_lf.point_renderer import render_views
from lerobot_policy_bimanual.rvt_lf.views import pixels_of_voxels

BOX = Workspace((-0.3, -0.5, 0.6), (0.7, 0.5, 1.2))
"""Not a cube, so that mistaken axes show."""


def cloud(samples: int, points: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Random points in and around the box."""
    unit = 1.4 * torch.rand(samples, 3, points) - 0.2
    positions = torch.tensor(BOX.lower)[:, None] + unit * torch.tensor(BOX.size).float()[:, None]
    return positions, 2 * torch.rand(samples, 3, points) - 1


def render(points: torch.Tensor, colours: torch.Tensor, size: int = 12, radius: float = 0.0) -> torch.Tensor:
    return render_views(points, colours, workspace=BOX, size=size, radius=radius)


def looks(x: float, y: float, z: float, far: float) -> list[tuple[float, float, float]]:
    """Row, column and depth of a point in each view, spelled out; `far` is what is opposite to 0."""
    return [
        (far - x, far - y, far - z),  # top
        (far - z, y, far - x),  # front
        (far - z, far - y, x),  # back
        (far - z, far - x, far - y),  # left
        (far - z, x, y),  # right
    ]


def written_out(points: torch.Tensor, colours: torch.Tensor, size: int, radius: float) -> torch.Tensor:
    """One sample, point by point and pixel by pixel."""
    images = torch.zeros(5, 10, size, size)
    lower, edges = torch.tensor(BOX.lower), torch.tensor(BOX.size).float()
    steps = torch.linspace(-1, 1, size).tolist()
    pixels = [*itertools.product(range(size), repeat=2)]
    for number in range(5):
        buffer = {}
        for point, colour in zip(points.T, colours.T, strict=True):
            unit = (point - lower) / edges
            if not ((unit >= 0) & (unit < 1)).all():
                continue
            cell = (unit * size).long().tolist()
            row, column, _ = looks(*cell, far=size - 1)[number]
            depth = looks(*(2 * unit - 1).tolist(), far=0)[number][2]
            for r, c in pixels:
                near_enough = (r - row) ** 2 + (c - column) ** 2 <= (radius * size / 2) ** 2
                if near_enough and depth < buffer.get((r, c), (9.0,))[0]:
                    buffer[r, c] = (depth, [*(2 * unit - 1).tolist(), *((colour + 1) / 2).tolist()])
        mean = sum(depth for depth, _ in buffer.values()) / len(buffer)
        for r, c in pixels:
            depth, content = buffer.get((r, c), (None, [0.0] * 6))
            images[number, :6, r, c] = torch.tensor(content)
            images[number, 6, r, c] = -1 if depth is None else depth - mean
            images[number, 7:, r, c] = torch.tensor([number / 2 - 1, steps[r], steps[c]])
    return images


@pytest.mark.parametrize("radius", [0.0, 0.22, 0.5])
def test_images_equal_a_loop_over_points_and_pixels(radius):
    points, colours = cloud(2, 60)
    points[0, 1, 7] = torch.nan
    expected = [written_out(*sample, 12, radius) for sample in zip(points, colours, strict=True)]
    torch.testing.assert_close(render(points, colours, radius=radius), torch.stack(expected))


def test_the_order_of_the_points_does_not_matter():
    points, colours = cloud(2, 2000)
    # Every coordinate has only four values, so most points hide others that are equally deep.
    points = torch.tensor(BOX.lower)[:, None] + torch.randint(0, 4, points.shape) / 4 + 0.01
    order = torch.randperm(points.shape[2])
    shuffled = render(points[..., order], colours[..., order], radius=0.2)
    assert torch.equal(shuffled, render(points, colours, radius=0.2))


def test_a_point_is_shown_by_the_pixels_of_its_voxel(random_keyposes):
    keyposes = random_keyposes(100)
    images = render(keyposes[:, :3, None], torch.ones(100, 3, 1))  # one point per sample
    rows, columns = pixels_of_voxels(TorchKeyposeCodec(BOX, 12).encode(keyposes).voxel[:, 0], 12)
    assert images[:, :, 3].flatten(2).argmax(2).equal(rows * 12 + columns)
