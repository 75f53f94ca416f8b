"""One hash for what a dataset says, whichever way its files are cut.

The hash covers what LeRobot's loader gives a policy, in the order of the episodes: every vector and scalar, LeRobot's
own columns (time, row, episode), the sentence, every decoded image, rows per second and the unit of depth. File
layout, shards, order of columns, compression of tables and packing of videos do not enter. Neither do the numbers of
files and sentences and the statistics: they follow from the rest.
"""

import hashlib
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.reader import TASK_INDEX, RecordedEpisode


class EpisodeHash:
    """The hash of one episode, whose images come row by row or key by key.

    Args:
        episode: its columns.
        units: what the numbers are measured in, see `ImageReader.units`.
    """

    def __init__(self, episode: RecordedEpisode, units: Mapping[str, object]):
        self._digest = hashlib.sha256(f"{episode.meta.instruction}\n{sorted(units.items())}\n".encode())
        bookkeeping = {key: column for key, column in episode.bookkeeping.items() if key != TASK_INDEX}
        for key, column in sorted((episode.columns | bookkeeping).items()):
            _add(self._digest, key, column)
        self._images: dict[str, hashlib._Hash] = {}

    def add_image(self, key: str, image: NDArray) -> None:
        """Add the next image of a key."""
        _add(self._images.setdefault(key, hashlib.sha256()), key, image)

    def hexdigest(self) -> str:
        """SHA-256 of all that was added."""
        digest = self._digest.copy()
        for _, images in sorted(self._images.items()):
            digest.update(images.digest())
        return digest.hexdigest()


def combined_hash(episode_hashes: Iterable[str]) -> str:
    """Hash of a dataset from those of its episodes, in order."""
    return hashlib.sha256("\n".join(episode_hashes).encode()).hexdigest()


def _add(digest: "hashlib._Hash", key: str, array: NDArray) -> None:
    if array.dtype == object:  # texts
        array = np.frombuffer("\n".join(array).encode(), np.uint8)
    digest.update(f"{key} {array.dtype.str} {array.shape}\n".encode())
    digest.update(np.ascontiguousarray(array).data)
