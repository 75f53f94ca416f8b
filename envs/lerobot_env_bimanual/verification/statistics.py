"""Statistics by which training normalises, computed again by LeRobot's functions and compared.

The table of episodes has those of every episode, `meta/stats.json` those of all rows, which LeRobot makes from them. How it
estimates quantiles differs between its versions: those of another version than the installed one only have to be in order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.provenance import Provenance, other_lerobot
from lerobot_bimanual.dataset.reader import (
    EPISODE_INDEX,
    INDEX,
    TASK_INDEX,
    RecordedEpisode,
    episode_table,
    read_info,
)
from lerobot_bimanual.files import read_json
from lerobot_env_bimanual.verification.fault import Fault

STATISTICS_FILE = Path("meta", "stats.json")
PREFIX = "stats/"

RENUMBERED = (EPISODE_INDEX, INDEX, TASK_INDEX)
"""Columns that get new numbers when shards are merged, after the statistics of all rows were taken."""

QUANTILES = ("q01", "q10", "q50", "q90", "q99")

TOLERANCE = 1e-3
"""Relative to a feature's largest number: LeRobot's estimate of a quantile is as fine as a bin of its histogram."""


def check_episode_statistics(root: Path, episode: RecordedEpisode, exactly: bool) -> Iterator[Fault]:
    """The stored statistics of one episode's vectors and numbers are those of its rows.

    Args:
        root: folder of the dataset.
        episode: the episode.
        exactly: whether the installed version of LeRobot wrote the dataset.
    """
    from lerobot.datasets.compute_stats import compute_episode_stats

    columns: dict[str, Any] = episode.columns | episode.bookkeeping
    with np.errstate(all="ignore"):  # other checks find numbers that are not finite
        computed = compute_episode_stats(columns, read_info(root)["features"])
    stored = _by_feature(episode_table(root).slice(episode.index, 1).to_pylist()[0])
    yield from _differences(stored, computed, exactly)


def check_dataset_statistics(root: Path) -> Iterator[Fault]:
    """`meta/stats.json` is what LeRobot makes of the statistics of the episodes."""
    from lerobot.datasets.compute_stats import aggregate_stats

    stored = read_json(root / STATISTICS_FILE)
    computed = aggregate_stats([_by_feature(entry) for entry in episode_table(root).to_pylist()])
    if stored.keys() != computed.keys():
        yield Fault(f"statistics are of {sorted(stored)}, not of {sorted(computed)}")
    computed = {key: values for key, values in computed.items() if key not in RENUMBERED}
    yield from _differences(stored, computed, not other_lerobot(Provenance.of_dataset(root)))


def _by_feature(entry: Mapping[str, Any]) -> dict[str, dict[str, NDArray]]:
    """Feature -> statistics, from a row of the table of episodes."""
    features: dict[str, dict[str, NDArray]] = {}
    for name, value in entry.items():
        if name.startswith(PREFIX):
            key, _, statistic = name.removeprefix(PREFIX).rpartition("/")
            features.setdefault(key, {})[statistic] = np.asarray(value)
    return features


def _differences(
    stored: Mapping[str, Mapping[str, Any]], computed: Mapping[str, Mapping[str, NDArray]], exactly: bool
) -> Iterator[Fault]:
    """Faults of the stored statistics of the computed features."""
    for key, wanted in computed.items():
        scale = max(float(np.abs(wanted[name].astype(np.float64)).max()) for name in ("min", "max"))
        if not exactly:
            yield from _disorder(key, stored.get(key, {}), TOLERANCE * scale + 1e-9)
        for name, values in wanted.items():
            if name in QUANTILES and not exactly:
                continue
            found = np.ravel(np.asarray(stored.get(key, {}).get(name, np.nan), np.float64))
            tolerance = 0 if name == "count" else TOLERANCE * scale + 1e-9
            if found.size != values.size or not np.allclose(found, values.ravel(), rtol=0, atol=tolerance):
                has, ours = (np.array2string(some[:4], precision=4) for some in (found, values.ravel()))
                yield Fault(f"{name} of {key} is {has}, but its rows have {ours}")


def _disorder(key: str, stored: Mapping[str, Any], tolerance: float) -> Iterator[Fault]:
    """A fault where a quantile is smaller than a lower one or the minimum, or larger than the maximum."""
    names = ["min", *QUANTILES, "max"]
    values = [np.ravel(np.asarray(stored.get(name, np.nan), np.float64)) for name in names]
    for lower, upper, name, next_name in zip(values, values[1:], names, names[1:], strict=False):
        if lower.shape != upper.shape or not (lower <= upper + tolerance).all():
            yield Fault(f"{name} of {key} is larger than its {next_name}, or one of them is missing")
