"""Checks of an episode's images that need no simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.schema import DEPTH_MAX_M, DEPTH_MIN_M, MM_PER_M
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.fault import Fault

COMPLETE, DEPTH_RANGE = "images complete", "depth range"
MIN_MM, MAX_MM = round(DEPTH_MIN_M * MM_PER_M), round(DEPTH_MAX_M * MM_PER_M)


def inspected_images(
    reader: ImageReader, episode: int, rows: int, faults: Mapping[str, list[Fault]]
) -> Iterator[tuple[str, int, NDArray]]:
    """(key, row, image) of all images of an episode, key by key; an image that cannot be decoded ends its key.

    Args:
        reader: of the dataset.
        episode: index.
        rows: number of rows that the episode's table has.
        faults: gets the faults of the checks `COMPLETE` and `DEPTH_RANGE`.
    """
    for key, shape in reader.shapes.items():
        row, form = 0, (shape, np.dtype(np.uint16 if reader.is_depth(key) else np.uint8))
        try:
            for image in reader.images(episode, key):
                if row == rows or ((*image.shape, 1)[:3], image.dtype) != form:
                    break
                if reader.is_depth(key) and (image.min() < MIN_MM or image.max() > MAX_MM):
                    text = f"{key} reaches from {image.min()} to {image.max()} mm, beyond {MIN_MM} to {MAX_MM} mm"
                    faults[DEPTH_RANGE].append(Fault(text, row))
                yield key, row, image
                row += 1
            else:
                if row < rows:
                    faults[COMPLETE].append(Fault(f"{key} has {row} images, but the episode {rows} rows"))
                continue
            text = f"{key} has more images than rows, or one that is not {form[1]} {shape}"
            faults[COMPLETE].append(Fault(text, row))
        except DatasetError as error:
            faults[COMPLETE].append(Fault(str(error), row))
