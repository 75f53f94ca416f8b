"""What LeRobot's loader gives a policy, beside what was checked: the same numbers, images and words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.reader import RecordedEpisode, data_file, read_info, read_table
from lerobot_env_bimanual.verification.fault import Fault

TOLERANCE_S = 1e-4
"""LeRobot's own, between the time of a row and that of its images."""


class LeRobotLoader:
    """LeRobot's reader of one view, which decodes with PyAV as `ImageReader` does.

    It is given the file of an episode's rows in memory, where `LeRobotDataset` would copy all files into its cache; and
    it never asks the Hub, provided that the files of `meta` are there.

    Args:
        root: folder of the view, whose files and description were checked.
        cache: folder for LeRobot's copy of the table of episodes.
    """

    def __init__(self, root: Path, cache: Path):
        import datasets.config
        from lerobot.datasets.dataset_metadata import LeRobotDatasetMetadata
        from lerobot.datasets.dataset_reader import DatasetReader

        datasets.config.HF_DATASETS_CACHE = cache
        self._root = root
        self._meta = LeRobotDatasetMetadata("local/verified", root=root)
        self._reader = DatasetReader(
            self._meta,
            root,
            episodes=None,
            tolerance_s=TOLERANCE_S,
            video_backend="pyav",
            delta_timestamps=None,
            image_transforms=None,
        )
        self._loaded: Path | None = None
        self._first_row: dict[int, int] = {}

    def check(self, episode: RecordedEpisode, images: Mapping[int, Mapping[str, NDArray]]) -> Iterator[Fault]:
        """Some rows of an episode come from LeRobot's loader as they were checked.

        Args:
            episode: its columns.
            images: row -> key -> image as it was decoded for the other checks.
        """
        self._load(episode.index)
        for row, wanted in images.items():
            item = self._reader.get_item(self._first_row[episode.index] + row)
            for key, column in (episode.columns | episode.bookkeeping).items():
                if not np.array_equal(np.squeeze(item[key]), np.squeeze(column[row])):
                    yield Fault(f"LeRobot gives {key} as {item[key]}", row)
            for key, image in wanted.items():
                if not np.array_equal(_stored(item[key]), image):
                    yield Fault(f"LeRobot gives another image of {key}", row)
            if item["task"] != episode.meta.instruction:
                yield Fault(f"LeRobot gives the sentence {item['task']!r}", row)

    def _load(self, episode: int) -> None:
        import datasets
        from datasets.table import InMemoryTable, table_cast
        from lerobot.datasets.feature_utils import get_hf_features_from_features
        from lerobot.datasets.io_utils import hf_transform_to_torch

        entries: Any = self._meta.episodes
        path = data_file(self._root, read_info(self._root), entries[episode])
        if path == self._loaded:
            return
        features = get_hf_features_from_features(self._meta.features)
        table = read_table(path).select(list(features))
        numbers = np.asarray(table["episode_index"])
        self._first_row = {int(number): int(np.argmax(numbers == number)) for number in np.unique(numbers)}
        rows: Any = datasets.Dataset(InMemoryTable(table_cast(table, features.arrow_schema)))
        rows.set_transform(hf_transform_to_torch)
        self._reader.hf_dataset = rows
        self._loaded = path


def _stored(image: Any) -> NDArray:
    """LeRobot's tensor, RGB (3, H, W) in 0..1 or depth (1, H, W) in mm, as it was stored."""
    array = np.asarray(image)
    if array.shape[0] == 1:
        return np.rint(array[0]).astype(np.uint16)
    return np.rint(array.transpose(1, 2, 0) * 255).astype(np.uint8)
