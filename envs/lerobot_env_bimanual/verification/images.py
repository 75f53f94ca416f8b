"""Checks of an episode's images that need no simulation."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.schema import DEPTH_MAX_M, DEPTH_MIN_M, MM_PER_M
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.fault import Fault

COMPLETE, DEPTH_RANGE = "images complete", "depth range"


class ImageInspection:
    """Checks the images of one episode while they are decoded.

    Args:
        reader: of the dataset.
        episode: index.
        rows: that the episode's table has.
    """

    def __init__(self, reader: ImageReader, episode: int, rows: int):
        self._reader = reader
        self._episode = episode
        self._rows = rows
        self._faults: dict[str, list[Fault]] = {COMPLETE: [], DEPTH_RANGE: []}

    def images(self) -> Iterator[tuple[str, int, NDArray]]:
        """(key, row, image) of all images, key by key; one that cannot be decoded is the end of its key."""
        for key in self._reader.shapes:
            stream = self._reader.images(self._episode, key)
            for row in count():
                image = self._next(key, row, stream)
                if image is None:
                    break
                yield key, row, image

    def faults(self) -> dict[str, tuple[Fault, ...]]:
        """What was seen in the images that were read."""
        return {check: tuple(faults) for check, faults in self._faults.items()}

    @property
    def is_whole(self) -> bool:
        """Whether there is an image of the right form for every row and key."""
        return not self._faults[COMPLETE]

    def _next(self, key: str, row: int, stream: Iterator[NDArray]) -> NDArray | None:
        """The image of a row, if it is there and has the right form."""
        try:
            image = next(stream, None)
        except DatasetError as error:
            self._miss(Fault(str(error), row))
            return None
        if image is None or row >= self._rows:
            if image is not None or row < self._rows:
                images = f"{row} images" if image is None else "more images"
                self._miss(Fault(f"{key} has {images}, but the episode {self._rows} rows"))
            return None
        form, expected = ((*image.shape, 1)[:3], image.dtype), self._reader.shapes[key]
        if form != (expected, np.uint16 if self._reader.is_depth(key) else np.uint8):
            self._miss(Fault(f"{key} has the form {form[1]} {form[0]}, not {expected}", row))
            return None
        if self._reader.is_depth(key):
            self._check_range(key, row, image)
        return image

    def _miss(self, fault: Fault) -> None:
        self._faults[COMPLETE].append(fault)

    def _check_range(self, key: str, row: int, depth_mm: NDArray) -> None:
        low, high = round(DEPTH_MIN_M * MM_PER_M), round(DEPTH_MAX_M * MM_PER_M)
        least, most = int(np.min(depth_mm)), int(np.max(depth_mm))
        if least < low or most > high:
            self._faults[DEPTH_RANGE].append(
                Fault(f"{key} reaches from {least} to {most} mm, beyond {low} to {high} mm", row)
            )
