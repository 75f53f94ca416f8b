"""The five orthographic views of the workspace, as RVT uses them.

Every view looks at one face of the workspace from outside and fills its image with that face. Seen from a robot
that stands at small x and looks along +x, with +y to its left: "front" looks back at the robot, "left" and
"right" look from its sides. Its pixels are the lattice of voxels seen end on, so that a voxel lies in one pixel
of every view, and a pixel shows one row of voxels.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from lerobot_policy_bimanual.nn.layers import gaussian_1d

X, Y, Z, MINUS_X, MINUS_Y, MINUS_Z = range(6)
"""Signed axes of the workspace, as indices into coordinates followed by mirrored coordinates."""


@dataclass(frozen=True)
class View:
    """One orthographic view.

    Attributes:
        name: the face that is seen.
        row: signed axis along which the image's rows count, from its top.
        column: signed axis along which its columns count, from its left.
        depth: signed axis along which it looks.
    """

    name: str
    row: int
    column: int
    depth: int


VIEWS = (
    View("top", row=MINUS_X, column=MINUS_Y, depth=MINUS_Z),
    View("front", row=MINUS_Z, column=Y, depth=MINUS_X),
    View("back", row=MINUS_Z, column=MINUS_Y, depth=X),
    View("left", row=MINUS_Z, column=MINUS_X, depth=MINUS_Y),
    View("right", row=MINUS_Z, column=X, depth=Y),
)
"""In the order of RVT (RVT code)."""

ROWS = [view.row for view in VIEWS]
COLUMNS = [view.column for view in VIEWS]


def pixels_of_voxels(voxel: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """Rows and columns (..., views) at which views of `size` pixels per side see voxels (..., 3)."""
    both = torch.cat([voxel, size - 1 - voxel], dim=-1)
    return both[..., ROWS], both[..., COLUMNS]


def with_mark(images: Tensor, place: Tensor) -> Tensor:
    """Views (b, views, c, size, size) and, behind their channels, one that is 1 where places (b, 3) are seen and falls off."""
    rows, columns = (
        gaussian_1d(pixels, images.shape[-1]) for pixels in pixels_of_voxels(place, images.shape[-1])
    )
    mark = (rows[..., :, None] * columns[..., None, :]).to(images.dtype)  # (b, views, size, size)
    return torch.cat([images, mark[:, :, None]], dim=2)


def magnified(place: Tensor, middle: Tensor, zoom: int, size: int) -> Tensor:
    """Where places (..., 3) in voxels lie among `size` voxels per axis that are `zoom` times smaller, around middles (..., 3)."""
    return (place - middle) * zoom + (size - 1) / 2


def reduced(place: Tensor, middle: Tensor, zoom: int, size: int) -> Tensor:
    """Inverse of `magnified`: where places (..., 3) in its smaller voxels lie in the larger ones."""
    return middle + (place - (size - 1) / 2) / zoom


def sum_over_views(images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Add up those of images (..., views, size, size) that see the same two axes: planes xy, xz, yz (..., size, size).

    Each voxel (x, y, z) collects xy[x, y] + xz[x, z] + yz[y, z] from the five images.
    """
    planes: dict[tuple[int, int], Tensor] = {}
    for view, image in zip(VIEWS, images.unbind(-3), strict=True):
        axes, is_swapped, mirrored = _orientation(view)
        image = image.flip(mirrored)
        image = image.transpose(-2, -1) if is_swapped else image
        planes[axes] = planes[axes] + image if axes in planes else image
    return planes[X, Y], planes[X, Z], planes[Y, Z]


def images_of_planes(xy: Tensor, xz: Tensor, yz: Tensor) -> Tensor:
    """Planes (..., size, size) as the views see them, (..., views, size, size): the opposite of `sum_over_views`."""
    planes, images = {(X, Y): xy, (X, Z): xz, (Y, Z): yz}, []
    for view in VIEWS:
        axes, is_swapped, mirrored = _orientation(view)
        image = planes[axes].transpose(-2, -1) if is_swapped else planes[axes]
        images.append(image.flip(mirrored))
    return torch.stack(images, dim=-3)


def _orientation(view: View) -> tuple[tuple[int, int], bool, list[int]]:
    """The two axes that a view sees, whether its rows count along the second one, and which dimensions are mirrored."""
    first, second = view.row % 3, view.column % 3
    mirrored = [dim for dim, axis in ((-2, view.row), (-1, view.column)) if axis >= MINUS_X]
    return (min(first, second), max(first, second)), first > second, mirrored
