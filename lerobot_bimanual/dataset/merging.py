"""Datasets of equal features as one, file by file.

LeRobot's `aggregate_datasets` gives the same result, but spends over a CPU second per source on lists of the some hundred
features of its tables. Here videos keep their files and tables get new numbers, so that merging costs next to nothing
beside recording. A test holds the two against each other.
"""

from __future__ import annotations

import json
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from lerobot.datasets.compute_stats import aggregate_stats
from lerobot.datasets.io_utils import (
    load_info,
    load_stats,
    load_tasks,
    write_info,
    write_stats,
    write_table_one_row_group_per_episode,
    write_tasks,
)
from lerobot.datasets.utils import DEFAULT_EPISODES_PATH
from numpy.typing import ArrayLike, NDArray

from lerobot_bimanual.errors import DatasetError

DESCRIPTION = b"huggingface"
"""Where the `datasets` library notes the features of a Parquet file."""
CHUNK, FILE = "chunk_index", "file_index"
SHIFTED_STATISTICS = ("min", "max", "mean", "q01", "q10", "q50", "q90", "q99")
"""Those that move with the values of a column."""


def merge_datasets(sources: Sequence[Path], root: Path) -> None:
    """Write a dataset that holds the episodes of several, in their order; every source keeps its own files in it.

    Args:
        sources: folders of datasets; they are left as they are. Videos are linked where the file system can.
        root: new folder.

    Raises:
        DatasetError: the sources differ in their features or rates.
    """
    infos = [load_info(source) for source in sources]
    first = infos[0]
    for source, info in zip(sources, infos, strict=True):
        if (info.features, info.fps, info.robot_type) != (first.features, first.fps, first.robot_type):
            raise DatasetError(
                f"{source} and {sources[0]} differ in features or rate: they cannot be one dataset"
            )
    sentences = list(dict.fromkeys(sentence for source in sources for sentence in load_tasks(source).index))
    merger = _Merger(root, sentences, first.chunks_size)
    episodes = pa.concat_tables([merger.add(source) for source in sources])
    path = root / DEFAULT_EPISODES_PATH.format(chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True)
    pq.write_table(episodes, path)
    write_tasks(
        pd.DataFrame({"task_index": range(len(sentences))}, index=pd.Index(sentences, name="task")), root
    )
    first.total_episodes, first.total_frames = merger.episodes, merger.rows
    first.total_tasks, first.splits = len(sentences), {"train": f"0:{merger.episodes}"}
    write_info(first, root)
    write_stats(aggregate_stats([stats for source in sources if (stats := load_stats(source))]), root)


class _Merger:
    """Takes over data and videos, source by source.

    Args:
        root: folder of the new dataset.
        sentences: all sentences, by their new index.
        chunk_size: files per folder.

    Attributes:
        episodes: taken over so far.
        rows: of these.
    """

    def __init__(self, root: Path, sentences: Sequence[str], chunk_size: int):
        self._root, self._sentences, self._chunk_size = root, sentences, chunk_size
        self._files: Counter[str] = Counter()
        self.episodes = self.rows = 0

    def add(self, source: Path) -> pa.Table:
        """Take over a dataset; returns its table of episodes with the numbers that hold in the new one."""
        tables = [pq.read_table(path) for path in sorted(source.glob("meta/episodes/*/*.parquet"))]
        episodes = pa.concat_tables(tables)
        new_task = np.array([self._sentences.index(sentence) for sentence in load_tasks(source).index])
        for name in episodes.column_names:
            kind, _, number = name.rpartition("/")
            if number != CHUNK:
                continue
            if kind == "meta/episodes":  # all in one file
                episodes = _with(_with(episodes, f"{kind}/{CHUNK}", 0), f"{kind}/{FILE}", 0)
                continue
            moves, episodes = self._renumbered(episodes, kind)
            for old, new in moves:
                (self._root / new).parent.mkdir(parents=True, exist_ok=True)
                if kind == "data":
                    self._write_rows(pq.read_table(source / old), self._root / new, new_task)
                else:
                    _link(source / old, self._root / new)
        episodes = self._numbered(episodes)
        self.episodes += len(episodes)
        self.rows += int(_values(episodes, "length").sum())
        return episodes

    def _renumbered(self, episodes: pa.Table, kind: str) -> tuple[list[tuple[str, str]], pa.Table]:
        """Old and new path of each file of a kind, and the episodes with the new numbers."""
        suffix = ".parquet" if kind == "data" else ".mp4"
        old = np.stack([_values(episodes, f"{kind}/{CHUNK}"), _values(episodes, f"{kind}/{FILE}")], axis=1)
        files, of_episode = np.unique(old, axis=0, return_inverse=True)
        new = np.stack(np.divmod(self._files[kind] + np.arange(len(files)), self._chunk_size), axis=1)
        self._files[kind] += len(files)
        for column, name in enumerate((CHUNK, FILE)):
            episodes = _with(episodes, f"{kind}/{name}", new[of_episode.ravel(), column])
        paths = [
            [f"{kind}/chunk-{c:03d}/file-{f:03d}{suffix}" for c, f in numbers] for numbers in (files, new)
        ]
        return list(zip(*paths, strict=True)), episodes

    def _write_rows(self, table: pa.Table, path: Path, new_task: NDArray[np.integer]) -> None:
        table = _with(table, "episode_index", _values(table, "episode_index") + self.episodes)
        table = _with(table, "index", _values(table, "index") + self.rows)
        table = _with(table, "task_index", new_task[_values(table, "task_index")])
        write_table_one_row_group_per_episode(_without_fingerprint(table), path)

    def _numbered(self, episodes: pa.Table) -> pa.Table:
        """The table of episodes, which also holds statistics of the columns that get new numbers."""
        offsets = {"episode_index": self.episodes, "index": self.rows}
        for name in ("dataset_from_index", "dataset_to_index"):
            episodes = _with(episodes, name, _values(episodes, name) + self.rows)
        episodes = _with(episodes, "episode_index", _values(episodes, "episode_index") + self.episodes)
        tasks = [self._sentences.index(sentence) for (sentence,) in episodes["tasks"].to_pylist()]
        for statistic in SHIFTED_STATISTICS:
            for column, offset in offsets.items():
                name = f"stats/{column}/{statistic}"
                shifted = [[value + offset for value in values] for values in episodes[name].to_pylist()]
                episodes = _with(episodes, name, shifted)
            episodes = _with(episodes, f"stats/task_index/{statistic}", [[float(task)] for task in tasks])
        return episodes


def _values(table: pa.Table, name: str) -> NDArray[np.int64]:
    return table[name].to_numpy()


def _with(table: pa.Table, name: str, values: ArrayLike) -> pa.Table:
    """The table with other values in a column; one value stands for all."""
    index = table.column_names.index(name)
    column = [values] * len(table) if np.isscalar(values) else values
    return table.set_column(
        index, table.schema.field(index), pa.array(column, table.schema.field(index).type)
    )


def _without_fingerprint(table: pa.Table) -> pa.Table:
    """The table without a key of the `datasets` cache that differs each time it is written."""
    described = json.loads(table.schema.metadata[DESCRIPTION])
    described.pop("fingerprint", None)
    return table.replace_schema_metadata({**table.schema.metadata, DESCRIPTION: json.dumps(described)})


def _link(old: Path, new: Path) -> None:
    try:
        os.link(old, new)
    except OSError:  # another device, or a file system without links
        shutil.copyfile(old, new)
