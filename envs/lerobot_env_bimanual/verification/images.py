"""Checks of an episode's images that need no simulation; every image is decoded once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.schema import DEPTH_MAX_M, DEPTH_MIN_M, MM_PER_M
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.fault import Fault

COMPLETE, DEPTH_RANGE = "images complete", "depth range"


class ImageInspection:
    """Looks at the images of one episode while somebody else reads them.

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

    def streams(self) -> dict[str, Iterator[NDArray]]:
        """The images of every key, under observation; one that cannot be decoded ends its stream."""
        return {key: self._watched(key) for key in self._reader.shapes}

    def faults(self) -> dict[str, tuple[Fault, ...]]:
        """What was seen in the streams that were read."""
        return {check: tuple(faults) for check, faults in self._faults.items()}

    @property
    def is_broken(self) -> bool:
        """Whether images are missing, so that there is nothing to compare with new ones."""
        return bool(self._faults[COMPLETE])

    def _watched(self, key: str) -> Iterator[NDArray]:
        is_depth = self._reader.is_depth(key)
        count = 0
        try:
            for image in self._reader.images(self._episode, key):
                self._check_shape(key, count, image)
                if is_depth:
                    self._check_range(key, count, image)
                yield image
                count += 1
        except DatasetError as error:
            self._faults[COMPLETE].append(Fault(str(error), count))
            return
        if count != self._rows:
            self._faults[COMPLETE].append(
                Fault(f"{key} has {count} images, but the episode {self._rows} rows")
            )

    def _check_shape(self, key: str, row: int, image: NDArray) -> None:
        expected = self._reader.shapes[key]
        found = (*image.shape, 1)[:3]
        if found != expected:
            self._faults[COMPLETE].append(Fault(f"{key} has the shape {found}, not {expected}", row))

    def _check_range(self, key: str, row: int, depth_mm: NDArray) -> None:
        low, high = round(DEPTH_MIN_M * MM_PER_M), round(DEPTH_MAX_M * MM_PER_M)
        least, most = int(np.min(depth_mm)), int(np.max(depth_mm))
        if least < low or most > high:
            self._faults[DEPTH_RANGE].append(
                Fault(f"{key} reaches from {least} to {most} mm, beyond {low} to {high} mm", row)
            )
