"""Rendered views show the cloud from five sides."""

import pytest
import torch

from lerobot_bimanual.codec_torch import TorchKeyposeCodec
from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_policy_bimanual.rvt_lf.point_renderer import render_views
from lerobot_policy_bimanual.rvt_lf.views import pixels_of_voxels

BOX = Workspace((-0.3, -0.5, 0.6), (0.7, 0.5, 1.2))
"""Not a cube, so that mistaken axes show."""

NAMES = ["top", "front", "back", "left", "right"]


def cloud(samples: int, points: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Random points in and around the box."""
    unit = 1.4 * torch.rand(samples, 3, points) - 0.2
    positions = torch.tensor(BOX.lower)[:, None] + unit * torch.tensor(BOX.size).float()[:, None]
    return positions, 2 * torch.rand(samples, 3, points) - 1


def render(points: torch.Tensor, colours: torch.Tensor, size: int = 12, radius: float = 0.0) -> torch.Tensor:
    return render_views(points, colours, workspace=BOX, size=size, radius=radius)


def look(view: str, x: float, y: float, z: float, far: float) -> tuple[float, float, float]:
    """Row, column and depth of a point in each view, spelled out; `far` is what is opposite to 0."""
    return {
        "top": (far - x, far - y, far - z),
        "front": (far - z, y, far - x),
        "back": (far - z, far - y, x),
        "left": (far - z, far - x, far - y),
        "right": (far - z, x, y),
    }[view]


def written_out(points: torch.Tensor, colours: torch.Tensor, size: int, radius: float) -> torch.Tensor:
    """One sample, point by point and pixel by pixel."""
    images = torch.zeros(5, 10, size, size)
    lower, edges = torch.tensor(BOX.lower), torch.tensor(BOX.size).float()
    steps = torch.linspace(-1, 1, size).tolist()
    for number, view in enumerate(NAMES):
        buffer = {}
        for point, colour in zip(points.T, colours.T, strict=True):
            unit = (point - lower) / edges
            if not ((unit >= 0) & (unit < 1)).all():
                continue
            cell = (unit * size).long().tolist()
            row, column, _ = look(view, *cell, far=size - 1)
            depth = look(view, *(2 * unit - 1).tolist(), far=0)[2]
            for r in range(size):
                for c in range(size):
                    near_enough = (r - row) ** 2 + (c - column) ** 2 <= (radius * size / 2) ** 2
                    if near_enough and depth < buffer.get((r, c), (9.0,))[0]:
                        buffer[r, c] = (depth, [*(2 * unit - 1).tolist(), *((colour + 1) / 2).tolist()])
        mean = sum(depth for depth, _ in buffer.values()) / len(buffer)
        for r in range(size):
            for c in range(size):
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


@pytest.mark.parametrize("ties", [False, True])
def test_the_order_of_the_points_does_not_matter(ties):
    points, colours = cloud(2, 2000)
    if ties:  # every coordinate has only four values, so most points hide others that are equally deep
        points = torch.tensor(BOX.lower)[:, None] + torch.randint(0, 4, points.shape) / 4 + 0.01
    order = torch.randperm(points.shape[2])
    shuffled = render(points[..., order], colours[..., order], radius=0.2)
    assert torch.equal(shuffled, render(points, colours, radius=0.2))


def test_a_points_voxel_is_in_the_pixel_that_shows_it():
    points, colours = cloud(1, 500)
    images = render(points, colours)[0]
    codec = TorchKeyposeCodec(BOX, 12, 5.0)
    keyposes = torch.zeros(500, 18)
    keyposes[:, :3] = points[0].T
    keyposes[:, 3] = keyposes[:, 12] = 1
    voxel = codec.encode(keyposes).voxel[:, 0]
    inside = ((voxel >= 0) & (voxel < 12)).all(dim=1)
    rows, columns = pixels_of_voxels(voxel[inside], 12)
    shown = images[torch.arange(5), :3, rows, columns]  # (points, views, xyz)
    true = 2 * (points[0].T[inside] - torch.tensor(BOX.lower)) / torch.tensor(BOX.size).float() - 1
    assert ((shown - true[:, None]).abs().amax(dim=2) < 1e-5).any(dim=1).sum() > 100
    planes = torch.tensor([[0, 1], [1, 2], [1, 2], [0, 2], [0, 2]])  # the axes that each view sees
    for view in range(5):
        distance = (shown[:, view, planes[view]] - true[:, planes[view]]).abs()
        assert distance.max() < 2 / 12
