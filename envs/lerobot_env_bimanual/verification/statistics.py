"""Statistics by which training normalises, computed again by LeRobot's functions and compared.

The table of episodes has those of every episode, `meta/stats.json` those of all rows, which LeRobot makes from them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.reader import (
    EPISODE_INDEX,
    INDEX,
    TASK_INDEX,
    RecordedEpisode,
    episode_table,
    is_depth,
    read_info,
)
from lerobot_bimanual.dataset.video import STATISTICS_EVERY
from lerobot_bimanual.files import read_json
from lerobot_env_bimanual.verification.fault import Fault

STATISTICS_FILE = Path("meta", "stats.json")
PREFIX = "stats/"

RENUMBERED = (EPISODE_INDEX, INDEX, TASK_INDEX)
"""Columns that get new numbers when shards are merged, after the statistics of all rows were taken."""

type Statistics = Mapping[str, NDArray]
"""Of one feature: "min", "max", "mean", "std", "count" and quantiles "q01" to "q99"."""

ROUNDING = 1e-5
"""Relative to a feature's largest number; float32 keeps 1e-7 of it, sums over an episode lose some of that."""

QUANTILE_BIN = 1e-3
"""Relative to a feature's largest number: LeRobot's estimate of a quantile is as fine as a bin of its histogram."""

LOSSY = {"min": 0.3, "max": 0.3, "mean": 0.03, "std": 0.08}
"""Largest errors of colours 0..1 of videos, whose statistics were taken before H.264 coded them; quantiles may move freely.

Measured over eight episodes of `lift_ball` at 128 pixels and six of two tasks at 24x32, all cameras: extremes move by up
to 0.13, means by 0.009, deviations by 0.027.
"""


class ImageStatistics:
    """Statistics of an episode's images of one key, as they were taken when it was recorded.

    Args:
        feature: LeRobot's description of the key.
    """

    def __init__(self, feature: dict[str, Any]):
        self._feature = feature
        self._images: list[NDArray] = []

    def add(self, image: NDArray) -> None:
        """Take the image of the next row."""
        self._images.append(image[..., None] if image.ndim == 2 else image)

    def result(self) -> Statistics:
        """Statistics per channel of the images so far."""
        from lerobot.datasets.compute_stats import (
            RunningQuantileStats,
            auto_downsample_height_width,
            get_feature_stats,
            sample_indices,
        )

        scale = 1.0 if is_depth(self._feature) else 255.0
        if self._feature["dtype"] == "image":  # as LeRobot's writer does with images in a table
            sampled = [self._images[row].transpose(2, 0, 1) for row in sample_indices(len(self._images))]
            images = np.stack([auto_downsample_height_width(image) for image in sampled])
            statistics = get_feature_stats(images, axis=(0, 2, 3), keepdims=True)
        else:  # as `lerobot_bimanual.dataset.video` does
            running = RunningQuantileStats()
            for image in self._images[::STATISTICS_EVERY]:
                running.update(image[::2, ::2].reshape(-1, image.shape[-1]))
            statistics = running.get_statistics()
        return {name: value if name == "count" else value / scale for name, value in statistics.items()}


def check_episode_statistics(
    root: Path, episode: RecordedEpisode, images: Mapping[str, ImageStatistics]
) -> Iterator[Fault]:
    """The stored statistics of one episode are those of its rows.

    Args:
        root: folder of the view.
        episode: its columns.
        images: key -> statistics of its images, of the keys that are compared.
    """
    from lerobot.datasets.compute_stats import compute_episode_stats

    features = read_info(root)["features"]
    columns: dict[str, Any] = episode.columns | episode.bookkeeping
    with np.errstate(all="ignore"):  # other checks find numbers that are not finite
        computed = compute_episode_stats(columns, features)
    computed |= {key: statistics.result() for key, statistics in images.items()}
    stored = _by_feature(episode_table(root).slice(episode.index, 1).to_pylist()[0])
    yield from _differences(stored, computed, features)


def check_dataset_statistics(root: Path) -> Iterator[Fault]:
    """`meta/stats.json` is what LeRobot makes of the statistics of the episodes."""
    from lerobot.datasets.compute_stats import aggregate_stats

    content = read_json(root / STATISTICS_FILE)
    stored = {
        key: {name: np.asarray(value) for name, value in values.items()} for key, values in content.items()
    }
    computed = aggregate_stats([_by_feature(entry) for entry in episode_table(root).to_pylist()])
    if stored.keys() != computed.keys():
        yield Fault(f"statistics are of {sorted(stored)}, not of {sorted(computed)}")
    compared = {key: values for key, values in computed.items() if key not in RENUMBERED}
    yield from _differences(stored, compared, {})


def _by_feature(entry: Mapping[str, Any]) -> dict[str, dict[str, NDArray]]:
    """Feature -> statistics, from a row of the table of episodes."""
    features: dict[str, dict[str, NDArray]] = {}
    for name, value in entry.items():
        if name.startswith(PREFIX):
            key, _, statistic = name.removeprefix(PREFIX).rpartition("/")
            features.setdefault(key, {})[statistic] = np.asarray(value)
    return features


def _differences(
    stored: Mapping[str, Statistics], computed: Mapping[str, Statistics], features: Mapping[str, Any]
) -> Iterator[Fault]:
    """Faults of the stored statistics of the computed features."""
    for key, wanted in computed.items():
        found = stored.get(key, {})
        scale = max(float(np.abs(wanted[name].astype(np.float64)).max()) for name in ("min", "max"))
        is_lossy = key in features and features[key]["dtype"] == "video" and not is_depth(features[key])
        for name in sorted(wanted.keys() | found.keys()):
            tolerance = (QUANTILE_BIN if name.startswith("q") else ROUNDING) * scale + 1e-9
            if is_lossy:
                tolerance = LOSSY.get(name, np.inf)
            if name == "count":
                tolerance = 0
            if name not in found or name not in wanted or not _agree(found[name], wanted[name], tolerance):
                yield Fault(
                    f"{name} of {key} is {_short(found.get(name))}, but its rows have {_short(wanted.get(name))}"
                )


def _agree(found: NDArray, wanted: NDArray, tolerance: float) -> bool:
    if found.dtype.kind not in "fiub" or found.size != wanted.size:
        return False
    difference = np.abs(found.astype(np.float64).ravel() - wanted.astype(np.float64).ravel())
    return bool((difference <= tolerance).all())


def _short(values: NDArray | None) -> str:
    if values is None:
        return "missing"
    return np.array2string(values.ravel()[:4], precision=4, threshold=4) + ("..." if values.size > 4 else "")
