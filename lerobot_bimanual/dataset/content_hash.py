"""One hash for what a dataset says, whichever way its files are cut.

The hash covers every vector and scalar of the schema, the instruction, and every decoded image, in the order of
the episodes. File layout, shards, order of columns, compression of tables and packing of videos do not enter, nor
does LeRobot's own bookkeeping. Two datasets with the same hash train the same policy.
"""

import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode


def content_hash(root: str | Path) -> str:
    """SHA-256 of one view, in hexadecimal; decodes every image, and holds one episode's table and one image.

    Raises:
        DatasetError: there is no dataset, or something in it cannot be read.
    """
    dataset, reader = RecordedDataset(root), ImageReader(root)
    return combined_hash(
        episode_hash(episode, {key: reader.images(episode.index, key) for key in reader.shapes})
        for episode in dataset.episodes()
    )


def episode_hash(episode: RecordedEpisode, images: Mapping[str, Iterable[NDArray]]) -> str:
    """SHA-256 of one episode.

    Args:
        episode: its columns.
        images: key -> decoded images in the order of the rows.
    """
    digest = hashlib.sha256(f"{episode.meta.instruction}\n".encode())
    for key, column in sorted(episode.columns.items()):
        _add(digest, key, column)
    for key, stream in sorted(images.items()):
        for image in stream:
            _add(digest, key, image)
    return digest.hexdigest()


def combined_hash(episode_hashes: Iterable[str]) -> str:
    """Hash of a dataset from those of its episodes, in order."""
    return hashlib.sha256("\n".join(episode_hashes).encode()).hexdigest()


def _add(digest: "hashlib._Hash", key: str, array: NDArray) -> None:
    if array.dtype == object:  # texts
        array = np.frombuffer("\n".join(array).encode(), np.uint8)
    digest.update(f"{key} {array.dtype.str} {array.shape}\n".encode())
    digest.update(np.ascontiguousarray(array).data)
