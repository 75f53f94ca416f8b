"""Wood, plaster and floor boards, painted by arithmetic: the same pixels on every machine, and no image file.

A texture is an array (height, width, 3) uint8 whose edges meet, so that it may repeat.
"""

import functools

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.gl import mujoco

type Image = NDArray[np.uint8]
type Field = NDArray[np.floating]


@functools.cache  # every scene shows the same
def boards(
    colour: tuple[float, float, float], size: tuple[int, int], count: int, joints: int, seed: int
) -> Image:
    """Boards along the image's width, each with its tone and grain.

    Args:
        colour: (3,) their mean, 0..1.
        size: (height, width) in pixels; the height is a multiple of `count`.
        count: boards one above the other.
        joints: along each board; 0 makes it as long as the image.
        seed: of grain and tones.
    """
    height, width = size
    rows, columns = np.mgrid[0:height, 0:width]
    board = rows * count // height
    starts = np.floor(uniform(seed, (count,)) * width).astype(int)[board]
    piece = (columns + starts) % width * max(joints, 1) // width
    tone = uniform(seed + 1, (count, max(joints, 1)))[board, piece] - 0.5
    shift = board * 37 + piece * 101  # each piece is cut from another place of the tree
    grain = noise(seed + 2, size, (height // 3, 6))[rows, (columns + shift) % width]
    rings = np.sin(2 * np.pi * (3 * noise(seed + 3, size, (count * 2, 3)) + 2.0 * rows / (height / count)))
    rings = rings[rows, (columns + 3 * shift) % width]
    shade = 1 + 0.09 * tone + 0.06 * (grain - 0.5) + 0.018 * rings
    shade[(rows * count) % height < count] *= 0.88
    if joints:
        shade[:, 1:][np.diff(piece, axis=1) != 0] *= 0.88
    return to_image(shade[..., None] * np.asarray(colour))


@functools.cache
def plaster(colour: tuple[float, float, float], size: tuple[int, int], skirting: int, seed: int) -> Image:
    """A painted wall, a little uneven, with a white skirting board below.

    Args:
        colour: (3,) of the paint, 0..1.
        size: (height, width) in pixels.
        skirting: its height in pixels.
        seed: of the unevenness.
    """
    height, width = size
    uneven = 0.5 * noise(seed, size, (8, 8)) + 0.5 * noise(seed + 1, size, (height // 2, width // 2))
    wall = (1 + 0.05 * (uneven - 0.5))[..., None] * np.asarray(colour)
    wall[height - skirting :] = 0.88
    wall[height - skirting] = 0.55
    return to_image(wall)


def noise(seed: int, size: tuple[int, int], cells: tuple[int, int]) -> Field:
    """Values 0..1 at the corners of cells, blended smoothly between them, and from edge to edge.

    Args:
        seed: of the values.
        size: (height, width) in pixels.
        cells: along height and width.
    """
    corners = uniform(seed, cells)
    row, row_share = _places(size[0], cells[0])
    column, column_share = _places(size[1], cells[1])
    upper, lower = corners[row], corners[(row + 1) % cells[0]]
    blend = upper + row_share[:, None] * (lower - upper)
    left, right = blend[:, column], blend[:, (column + 1) % cells[1]]
    return left + column_share * (right - left)


def uniform(seed: int, shape: tuple[int, ...]) -> Field:
    """Values 0..1 from the generator's raw bits, which no version of NumPy changes."""
    bits = np.random.PCG64(seed).random_raw(int(np.prod(shape)))
    return (bits >> np.uint64(11)).reshape(shape) * 2.0**-53


def to_image(values: Field) -> Image:
    """Colours 0..1 as bytes."""
    return np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)


def add_material(spec: mujoco.MjSpec, name: str, image: Image, repeat: tuple[float, float] = (1, 1)) -> None:
    """Add a texture and a dull material of the same name that shows it.

    Args:
        spec: the model under construction.
        name: of both.
        image: the texture.
        repeat: times along x and y of the geom that wears it.
    """
    height, width, _ = image.shape
    kind = mujoco.mjtTexture.mjTEXTURE_2D
    texture = spec.add_texture(name=name, type=kind, width=width, height=height, nchannel=3)
    texture.data = image[::-1].tobytes()  # MuJoCo counts rows from below
    material = spec.add_material(name=name, texrepeat=repeat, specular=0.0, shininess=0.3, reflectance=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


def _places(pixels: int, cells: int) -> tuple[NDArray[np.int_], Field]:
    """The cell of each pixel, and how far into it, eased at both ends."""
    place = (np.arange(pixels) + 0.5) * cells / pixels
    cell = place.astype(int) % cells
    share = place - np.floor(place)
    return cell, share * share * (3 - 2 * share)
