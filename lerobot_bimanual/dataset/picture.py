"""The picture of a dataset: its first episode in one strip, from the start over every keypose to the end."""

from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.output_file import write_file

PICTURE_FILE = Path("meta", "first_episode.jpg")
CAMERA = "front"
TILE_HEIGHT = 160
GAP = 4
"""Sizes in pixels."""


def write_picture(root: Path) -> None:
    """Draw the first episode as the front camera sees it, or the first camera that the dataset stores.

    Raises:
        UnwritableOutput: the picture cannot be written.
    """
    dataset = RecordedDataset(root)
    camera = CAMERA if CAMERA in dataset.cameras else dataset.cameras[0]
    shown = {0, *np.flatnonzero(dataset.episode(0).columns[schema.KEYFRAME]).tolist()}
    images = ImageReader(root).images(0, schema.image_key(camera))
    tiles = [_tile(image) for row, image in enumerate(images) if row in shown]
    lefts = np.cumsum([0, *(tile.width + GAP for tile in tiles)]).tolist()
    strip = Image.new("RGB", (lefts[-1] - GAP, TILE_HEIGHT), "white")
    for tile, left in zip(tiles, lefts, strict=False):  # the last left is where another tile would begin
        strip.paste(tile, (left, 0))
    drawn = BytesIO()
    strip.save(drawn, "JPEG", quality=85)
    write_file(root / PICTURE_FILE, drawn.getvalue())  # through no link, which may lead into the Hub's cache


def _tile(rgb: NDArray[np.uint8]) -> Image.Image:
    height, width, _ = rgb.shape
    return Image.fromarray(rgb).resize((round(width * TILE_HEIGHT / height), TILE_HEIGHT))
