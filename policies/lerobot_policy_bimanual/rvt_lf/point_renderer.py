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

    RVT's renderer blends the five nearest points of a pixel; here only the nearest one is shown. The images
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
        inside = (scaled.amin(1) >= 0) & (scaled.amax(1) < size)  # False for NaN
        count = inside.sum(dim=1)
        kept = inside.flatten().nonzero()[:, 0]  # one point in thirty of a zoomed-in view
        scaled, colours = (x.transpose(0, 1).flatten(1).index_select(1, kept) for x in (scaled, colours))
        content = torch.cat([scaled * (2 / size) - 1, colours / 2 + 0.5])

        index = _nearest_points(scaled, content, count, points.shape[2].bit_length(), size, radius)
        content = F.pad(content, (0, 1))  # the last one, which the index -1 is, shows nothing
        seen = content[:, index].movedim(0, 2)  # (b, views, 6, size, size)
        depth = _centred_depth(seen[:, :, :3], covered=index >= 0)[:, :, None]
        return torch.cat([seen, depth, _pixel_locations(size, seen).expand_as(seen[:, :, :3])], dim=2)


def _nearest_points(
    scaled: Tensor, content: Tensor, count: Tensor, index_bits: int, size: int, radius: float
) -> Tensor:
    """Index (b, views, size, size) int64 of the point that every pixel shows; -1 where there is none.

    Points are positions (3, m) in voxels and content (6, m) that tells them apart, those of the first sample first; `count`
    (b,) says how many each sample has.
    """
    first = count.cumsum(0) - count
    sample = torch.arange(len(count), device=count.device).repeat_interleave(count)
    low_bits = KEY_BITS - DEPTH_BITS
    tie_bits = low_bits - index_bits
    mixed = torch.zeros_like(sample)
    for bits, factor in zip(content.view(torch.int32), TIE_BREAKERS, strict=True):
        mixed.add_(bits, alpha=factor)
    low = ((mixed >> 16) & ((1 << tie_bits) - 1)) << index_bits
    low |= torch.arange(len(sample), device=low.device) - first[sample]

    cells = scaled.long()  # truncation is the floor of what is not negative
    depths = (scaled * (2**DEPTH_BITS / size)).long().clamp_(max=2**DEPTH_BITS - 1)
    nothing = (1 << KEY_BITS) - 1
    keys = low.new_full((len(VIEWS), len(count) * size**2), nothing)
    for image, view in zip(keys, VIEWS, strict=True):
        row, column = _along(cells, view.row, size), _along(cells, view.column, size)
        key = (_along(depths, view.depth, 2**DEPTH_BITS) << low_bits) | low
        image.scatter_reduce_(0, (sample * size + row) * size + column, key, "amin")
    keys = _splat_discs(keys.view(len(VIEWS), -1, size, size).transpose(0, 1), radius * size / 2, nothing)
    index = (keys & ((1 << index_bits) - 1)) + first[:, None, None, None]
    return index.masked_fill_(keys == nothing, -1)


def _along(coordinates: Tensor, axis: int, size: int) -> Tensor:
    """Integer coordinates (m,) along a signed axis, of (3, m) in 0 to size - 1."""
    return size - 1 - coordinates[axis - MINUS_X] if axis >= MINUS_X else coordinates[axis]


def _splat_discs(keys: Tensor, radius_px: float, nothing: int) -> Tensor:
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


def _centred_depth(xyz: Tensor, covered: Tensor) -> Tensor:
    """Depth (b, views, size, size) of points (b, views, 3, size, size), less its mean in each view."""
    depth = torch.cat([xyz, -xyz], dim=2)[:, range(len(VIEWS)), [view.depth for view in VIEWS]]
    count = covered.sum((2, 3), keepdim=True).clamp(min=1)
    return torch.where(covered, depth - depth.sum((2, 3), keepdim=True) / count, NO_DEPTH)


def _pixel_locations(size: int, like: Tensor) -> Tensor:
    """View, row and column (views, 3, size, size) in [-1, 1]."""
    axes = [torch.linspace(-1, 1, steps).to(like) for steps in (len(VIEWS), size, size)]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=1)
