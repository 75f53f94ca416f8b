"""Point clouds to images: five orthographic views with a z-buffer, in plain tensor operations."""

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from lerobot_bimanual.geometry.workspace import Workspace
from lerobot_policy_bimanual.rvt_lf.views import MINUS_X, VIEWS

VIEW_CHANNELS = 10
"""xyz in [-1, 1], RGB in [0, 1], depth less its mean, and view, row and column in [-1, 1] (RVT code)."""

QUADRATIC = slice(0, 6)
"""Channels whose squares may be channels, too: position and colour."""

NO_DEPTH = -1.0
"""Depth channel of pixels without a point; the six channels before it are 0 there."""

DEPTH_BITS = 24
"""Resolution of the z-buffer: 60 nm per metre, as fine as float32."""

KEY_BITS = 63
"""Bits of an int64 without its sign: depth, then tie-break, then the point's index."""

TIE_BREAKERS = (0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D, 0x27D4EB2F, 0x165667B1, 0xD3A2646D)
"""Odd numbers that mix a point's position and colour into its tie-break."""


def render_views(
    points: Tensor, colours: Tensor, *, workspace: Workspace, size: int, radius: float
) -> Tensor:
    """Render the five views of `VIEWS`.

    A point covers the pixels whose centres are within the radius of the centre of its own pixel, and hides what
    lies behind it. Among equally deep points a hash of position and colour of about 20 bits decides; only if
    that is equal too, the order of the points. Points outside the workspace vanish, NaN included.

    RVT's renderer blends the five nearest points of a pixel; here the nearest one stands alone. The images
    always span the workspace (RVT's `place_with_mean=False`), so that nothing but the scene moves them.

    Args:
        points: (b, 3, n) world positions in metres.
        colours: (b, 3, n) RGB in [-1, 1].
        workspace: the box that the views span, stretched to the cube [-1, 1]^3.
        size: pixels per side.
        radius: of a point, in units of the cube's half edge (RVT code: 0.012, so 1.3 of 220 pixels).

    Returns:
        (b, views, 10, size, size) float32, channels as in `VIEW_CHANNELS`. Without gradient.
    """
    with torch.no_grad():
        points, colours = points.float(), colours.float()
        lower = points.new_tensor(workspace.lower)[:, None]
        scaled = (points - lower) / points.new_tensor(workspace.size / size)[:, None]
        inside = (scaled.amin(1, keepdim=True) >= 0) & (scaled.amax(1, keepdim=True) < size)  # False for NaN
        # Points outside go anywhere, as nothing; not all to one pixel, for which they would queue on a GPU.
        anywhere = (torch.arange(points.shape[2], device=points.device) % size).to(points.dtype)
        scaled = torch.where(inside, scaled, anywhere)
        content = torch.cat([scaled * (2 / size) - 1, colours / 2 + 0.5], dim=1)

        index = _nearest_points(scaled, content, inside, size, radius)  # (b, views, size, size)
        seen = _look_up(content, index)  # (b, views, 6, size, size)
        covered = index < points.shape[2]
        depth = _centred_depth(seen[:, :, :3], covered)[:, :, None]
        return torch.cat([seen, depth, _pixel_locations(size, seen).expand_as(seen[:, :, :3])], dim=2)


def _nearest_points(scaled: Tensor, content: Tensor, inside: Tensor, size: int, radius: float) -> Tensor:
    """Index (b, views, size, size) int64 of the point that every pixel shows; n where there is none.

    Points are positions (b, 3, n) in voxels, content (b, 6, n) that tells them apart, and whether they exist (b, 1, n).
    """
    B, _, N = scaled.shape
    index_bits = N.bit_length()
    low_bits = KEY_BITS - DEPTH_BITS
    tie_bits = low_bits - index_bits
    mixed = torch.zeros(B, N, dtype=torch.int64, device=content.device)
    for bits, factor in zip(content.contiguous().view(torch.int32).unbind(1), TIE_BREAKERS, strict=True):
        mixed.add_(bits, alpha=factor)
    low = ((mixed >> 16) & ((1 << tie_bits) - 1)) << index_bits
    low |= torch.arange(N, device=low.device)
    nothing = (1 << KEY_BITS) - 1
    low.masked_fill_(~inside[:, 0], nothing)  # swallows the depth

    cells = scaled.long()  # truncation is the floor of what is not negative
    depths = (scaled * (2**DEPTH_BITS / size)).long().clamp_(max=2**DEPTH_BITS - 1)
    keys = low.new_full((B, len(VIEWS), size**2), nothing)
    for image, view in zip(keys.unbind(1), VIEWS, strict=True):
        pixel = _along(cells, view.row, size) * size + _along(cells, view.column, size)
        key = (_along(depths, view.depth, 2**DEPTH_BITS) << low_bits) | low
        image.scatter_reduce_(1, pixel, key, "amin")
    keys = _grow(keys.unflatten(2, (size, size)), radius * size / 2, nothing)
    return (keys & ((1 << index_bits) - 1)).clamp_(max=N)


def _along(coordinates: Tensor, axis: int, size: int) -> Tensor:
    """Integer coordinates (b, n) along a signed axis, of (b, 3, n) in 0 to size - 1."""
    return size - 1 - coordinates[:, axis - MINUS_X] if axis >= MINUS_X else coordinates[:, axis]


def _grow(keys: Tensor, radius_px: float, nothing: int) -> Tensor:
    """Smallest key (b, views, size, size) within a disc around every pixel.

    All points have the same disc around the centre of their pixel, so only the nearest one of each pixel matters.
    """
    width = int(radius_px)
    size = keys.shape[-1]
    # Not F.pad, which takes its value through a float and so loses the lowest bits of `nothing`.
    padded = keys.new_full((*keys.shape[:2], size + 2 * width, size + 2 * width), nothing)
    padded[:, :, width : width + size, width : width + size] = keys
    for row in range(-width, width + 1):
        for column in range(-width, width + 1):
            if row**2 + column**2 <= radius_px**2:
                window = padded[..., width + row :, width + column :][..., :size, :size]
                keys = torch.minimum(keys, window)
    return keys


def _look_up(content: Tensor, index: Tensor) -> Tensor:
    """Content (b, c, n) of the points that pixels show (b, views, size, size): (b, views, c, size, size)."""
    rows = F.pad(content, (0, 1)).transpose(1, 2).contiguous()  # the row after the last is nothing
    first = torch.arange(len(rows), device=index.device) * rows.shape[1]
    seen = rows.flatten(0, 1).index_select(0, (index + first[:, None, None, None]).flatten())
    return seen.view(*index.shape, -1).movedim(-1, 2)


def _centred_depth(xyz: Tensor, covered: Tensor) -> Tensor:
    """Depth (b, views, size, size) of points (b, views, 3, size, size), less its mean in each view."""
    depth = torch.stack(
        [
            -image[:, view.depth - MINUS_X] if view.depth >= MINUS_X else image[:, view.depth]
            for image, view in zip(xyz.unbind(1), VIEWS, strict=True)
        ],
        dim=1,
    )
    count = covered.sum((2, 3), keepdim=True).clamp(min=1)
    return torch.where(covered, depth - depth.sum((2, 3), keepdim=True) / count, NO_DEPTH)


def _pixel_locations(size: int, like: Tensor) -> Tensor:
    """View, row and column (views, 3, size, size) in [-1, 1]."""
    axes = [torch.linspace(-1, 1, steps).to(like) for steps in (len(VIEWS), size, size)]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=1)
