"""Statistics by which training normalises: computed again, by the recipe that generated them, and compared.

The table of episodes has those of every episode, `meta/stats.json` those of all rows, which LeRobot makes from them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.provenance import Provenance
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
from lerobot_bimanual.json_file import read_json
from lerobot_env_bimanual.verification.fault import Fault
from lerobot_env_bimanual.verification.plan import shard_sizes

STATISTICS_FILE = Path("meta", "stats.json")
PREFIX = "stats/"

type Statistics = Mapping[str, NDArray]
"""Of one feature: "min", "max", "mean", "std", "count" and quantiles "q01" to "q99"."""

ROUNDING = 1e-5
"""Relative to a feature's largest number; float32 keeps 1e-7 of it, sums over an episode lose some of that."""

BIN = 1e-3
"""Of quantiles, relative to a feature's largest number: LeRobot's estimate is as fine as a bin of its histogram."""

LOSSY = {"min": 0.3, "max": 0.3, "mean": 0.03, "std": 0.08}
"""Colours 0..1 of videos, whose statistics were taken before H.264 coded them.

Measured over eight episodes of `lift_ball` at 128 pixels and six of two tasks at 24x32, all cameras: extremes move by up to
0.13, means by 0.009, deviations by 0.027. Quantiles lie where they like when a few pixels cross an edge between two colours
(0.13 measured), so they only have to be in order.
"""


class ImageStatistics:
    """Statistics of the images of one key, fed row by row in the order of the rows.

    Args:
        feature: LeRobot's description of the key.
        rows: of the episode.
    """

    def __init__(self, feature: Mapping[str, Any], rows: int):
        from lerobot.datasets.compute_stats import sample_indices

        self._is_video = feature["dtype"] == "video"
        self._scale = 1.0 if is_depth(dict(feature)) else 255.0
        self._rows = set(range(0, rows, STATISTICS_EVERY) if self._is_video else sample_indices(rows))
        self._images: list[NDArray] = []
        self._running = _running_statistics(are_pixels=True)

    def add(self, row: int, image: NDArray) -> None:
        """Look at the image of a row, if the recipe does."""
        from lerobot.datasets.compute_stats import auto_downsample_height_width

        if row not in self._rows:
            return
        channels = image[..., None] if image.ndim == 2 else image
        if self._is_video:  # as `lerobot_bimanual.dataset.video` does
            self._running.update(_pixels(channels[::2, ::2]))
        else:  # as LeRobot's writer does with images in a table
            self._images.append(auto_downsample_height_width(channels.transpose(2, 0, 1)).transpose(1, 2, 0))

    def result(self) -> Statistics:
        """Statistics (channels, 1, 1) of the images so far."""
        if not self._is_video:
            self._running.update(np.concatenate([_pixels(image) for image in self._images]))
        statistics = self._running.get_statistics()
        pixels = statistics.pop("count")
        return {"count": pixels if self._is_video else np.array([len(self._images)])} | {
            name: value.reshape(-1, 1, 1) / self._scale for name, value in statistics.items()
        }


class StatisticsTable:
    """The stored statistics of every episode.

    Args:
        root: folder of one view.

    Raises:
        DatasetError: the table of episodes is damaged.
    """

    def __init__(self, root: Path):
        self._features = read_info(root)["features"]
        self._table = episode_table(root)

    def check(
        self, episode: RecordedEpisode, images: Mapping[str, ImageStatistics], unseen: Collection[str]
    ) -> Iterator[Fault]:
        """The statistics of one episode are those of its rows.

        Args:
            episode: its columns.
            images: statistics of its images by key.
            unseen: keys of images that nobody looked at.
        """
        columns = (episode.columns | episode.bookkeeping).items()
        with np.errstate(all="ignore"):  # numbers that are not finite are somebody else's finding
            computed = {key: _feature_statistics(values) for key, values in columns if values.dtype != object}
        computed |= {key: statistics.result() for key, statistics in images.items()}
        entry = self._table.slice(episode.index, 1).to_pylist()[0]
        stored = _by_feature({k.removeprefix(PREFIX): v for k, v in entry.items() if k.startswith(PREFIX)})
        seen = {key: statistics for key, statistics in stored.items() if key not in unseen}
        yield from _differences(seen, computed, self._features)


def check_dataset_statistics(root: Path) -> Iterator[Fault]:
    """`meta/stats.json` is what LeRobot makes of the statistics of the episodes."""
    from lerobot.datasets.compute_stats import aggregate_stats

    features = read_info(root)["features"]
    stored = read_json(root / STATISTICS_FILE)
    if not (isinstance(stored, dict) and all(isinstance(values, dict) for values in stored.values())):
        yield Fault(f"{STATISTICS_FILE} does not hold statistics by feature")
        return
    episodes = [
        _by_feature({k.removeprefix(PREFIX): v for k, v in entry.items() if k.startswith(PREFIX)})
        for entry in episode_table(root).to_pylist()
    ]
    for episode, offsets in zip(episodes, tuple(_offsets(root, episodes)), strict=True):
        for key, offset in offsets.items():
            episode[key] = {
                name: value if name in ("std", "count") else value - offset
                for name, value in episode[key].items()
            }
    computed = aggregate_stats([{k: dict(v) for k, v in episode.items()} for episode in episodes])
    found = {key: {name: _array(value) for name, value in values.items()} for key, values in stored.items()}
    yield from _differences(found, computed, features)


def _offsets(root: Path, episodes: list[dict[str, dict[str, NDArray]]]) -> Iterator[dict[str, float]]:
    """What was added to the numbers of an episode, its rows and its sentence after its shard's statistics were taken."""
    provenance = Provenance.of_dataset(root)
    sizes = shard_sizes(provenance) if provenance is not None else [len(episodes)]
    first = 0
    for size in sizes:
        shard = episodes[first : first + size]
        sentences: dict[float, int] = {}
        for episode in shard:
            sentence = float(episode[TASK_INDEX]["min"][0])
            in_shard = sentences.setdefault(sentence, len(sentences))
            yield {
                EPISODE_INDEX: float(shard[0][EPISODE_INDEX]["min"][0]),
                INDEX: float(shard[0][INDEX]["min"][0]),
                TASK_INDEX: sentence - in_shard,
            }
        first += size


def _by_feature(flat: Mapping[str, Any]) -> dict[str, dict[str, NDArray]]:
    features: dict[str, dict[str, NDArray]] = {}
    for name, value in flat.items():
        key, _, statistic = name.rpartition("/")
        features.setdefault(key, {})[statistic] = _array(value)
    return features


def _array(value: Any) -> NDArray:
    try:
        return np.asarray(value)
    except ValueError:  # rows of different lengths
        return np.asarray(value, dtype=object)


def _differences(
    stored: Mapping[str, Statistics], computed: Mapping[str, Statistics], features: Mapping[str, Any]
) -> Iterator[Fault]:
    for key in sorted(computed.keys() | stored.keys()):
        if key not in stored or key not in computed:
            yield Fault(f"{key} has {'no ' if key in computed else ''}statistics, and should be otherwise")
            continue
        found, wanted = stored[key], computed[key]
        scale = max(float(np.abs(wanted[name].astype(np.float64)).max()) for name in ("min", "max"))
        is_lossy = key in features and features[key]["dtype"] == "video" and not is_depth(features[key])
        if is_lossy and not _in_order(found):
            yield Fault(f"min, quantiles and max of {key} are not in order")
        for name in sorted(found.keys() | wanted.keys()):
            if name not in found or name not in wanted:
                yield Fault(f"{name} of {key} is {'missing' if name in wanted else 'no statistic'}")
            elif not _agree(name, found[name], wanted[name], scale, is_lossy):
                yield Fault(
                    f"{name} of {key} is {_short(found[name])}, but its rows have {_short(wanted[name])}"
                )


def _agree(name: str, found: NDArray, wanted: NDArray, scale: float, is_lossy: bool) -> bool:
    if found.shape != wanted.shape or found.dtype == object or found.dtype.kind not in "fiu":
        return False
    found, wanted = found.astype(np.float64), wanted.astype(np.float64)
    if name == "count":
        return bool(np.array_equal(found, wanted))
    if is_lossy:
        return name not in LOSSY or bool((np.abs(found - wanted) <= LOSSY[name]).all())
    if name == "std":  # a root, of a difference of large numbers
        return bool((found >= 0).all() and (np.abs(found**2 - wanted**2) <= ROUNDING * scale**2).all())
    close = BIN if name.startswith("q") else ROUNDING
    return bool((np.abs(found - wanted) <= close * scale + 1e-9).all())


def _in_order(statistics: Statistics) -> bool:
    names = ["min", *sorted(name for name in statistics if name.startswith("q")), "max"]
    values = [statistics[name] for name in names if name in statistics]
    shapes = {value.shape for value in values}
    return len(shapes) == 1 and all(
        value.dtype.kind in "fiu" and bool((low <= value + ROUNDING).all()) for low, value in pairwise(values)
    )


def _short(values: NDArray) -> str:
    return np.array2string(values.ravel()[:4], precision=4) + ("..." if values.size > 4 else "")


def _pixels(image: NDArray) -> NDArray:
    return image.reshape(-1, image.shape[-1])


def _feature_statistics(column: NDArray) -> Statistics:
    """Statistics of a vector (rows, n) or a scalar (rows,), as LeRobot's writer takes them."""
    from lerobot.datasets.compute_stats import get_feature_stats

    if len(column) < 2:
        return get_feature_stats(column, axis=0, keepdims=column.ndim == 1)
    running = _running_statistics(are_pixels=False)
    running.update(column.reshape(len(column), -1))
    return running.get_statistics()


def _running_statistics(are_pixels: bool) -> Any:
    """LeRobot's running statistics with the same numbers, and without its loops over histograms' bins."""
    from lerobot.datasets.compute_stats import RunningQuantileStats

    class Quick(RunningQuantileStats):
        _histograms: Any
        _bin_edges: Any
        _min: Any
        _max: Any
        _quantile_list: Any

        def _update_histograms(self, batch: NDArray) -> None:
            for channel, (histogram, edges) in enumerate(zip(self._histograms, self._bin_edges, strict=True)):
                values, counts = batch[:, channel], np.ones(len(batch))
                if are_pixels:  # whole numbers: each of them is put into its bin once, with all its like
                    counts = np.bincount(values.astype(np.intp))
                    values = np.flatnonzero(counts).astype(batch.dtype)
                    counts = counts[counts > 0]
                bins = np.searchsorted(edges, values, side="right") - 1
                np.add.at(histogram, np.clip(bins, 0, len(histogram) - 1), counts)

        def _adjust_histograms(self) -> None:
            for channel, (histogram, edges) in enumerate(zip(self._histograms, self._bin_edges, strict=True)):
                low, high = self._min[channel], self._max[channel]
                padding = (high - low) * 1e-10
                moved = np.linspace(low - padding, high + padding, len(edges))
                centers, filled = (edges[:-1] + edges[1:]) / 2, np.flatnonzero(histogram)
                bins = np.searchsorted(moved, centers[filled]) - 1
                counts = np.zeros_like(histogram)
                np.add.at(counts, np.clip(bins, 0, len(histogram) - 1), histogram[filled])
                self._histograms[channel], self._bin_edges[channel] = counts, moved

        def _compute_quantiles(self) -> list[NDArray]:
            targets = np.array(self._quantile_list) * self._count
            found = np.zeros((len(targets), len(self._histograms)))
            for channel, (histogram, edges) in enumerate(zip(self._histograms, self._bin_edges, strict=True)):
                filled = np.flatnonzero(histogram)
                sums = np.cumsum(histogram[filled])
                for place, target in enumerate(targets):
                    nth = int(np.searchsorted(sums, target))
                    bin_index = filled[nth] if nth < len(filled) else len(histogram)
                    if bin_index in (0, len(histogram)):
                        found[place, channel] = edges[bin_index and -1]
                        continue
                    before = sums[nth - 1] if nth else 0.0
                    fraction = (target - before) / (sums[nth] - before)
                    found[place, channel] = edges[bin_index] + fraction * (
                        edges[bin_index + 1] - edges[bin_index]
                    )
            return list(found)

    return Quick()
