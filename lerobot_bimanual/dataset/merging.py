"""Datasets of equal features as one, file by file.

LeRobot's `aggregate_datasets` gives the same values, but its tables lose the lengths of vectors, and no two runs write the
same bytes, by which a dataset that is made again is recognised. It also spends over a CPU second per source on lists of the
about one hundred features of its tables. Here videos keep their files and tables get new numbers, so merging takes almost
no time compared with recording. A test compares the two.
"""

import json
import os
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from lerobot.datasets import io_utils
from lerobot.datasets.compute_stats import aggregate_stats
from lerobot.datasets.utils import DEFAULT_DATA_PATH, DEFAULT_EPISODES_PATH, DEFAULT_VIDEO_PATH

from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.files import share_files

DESCRIPTION = b"huggingface"
"""Where the `datasets` library notes the features of a Parquet file."""
CHUNK, FILE = "chunk_index", "file_index"
SHIFTED_STATISTICS = ("min", "max", "mean", "q01", "q10", "q50", "q90", "q99")
"""Those that move with the values of a column."""


def merge_datasets(sources: Sequence[Path], root: Path) -> None:
    """Write a dataset that holds the episodes of several, in their order; every source keeps its own files in it.

    Sources are left as they are, and their videos are linked where the file system can.

    Raises:
        DatasetError: the sources differ in their features or rates.
    """
    infos = [io_utils.load_info(source) for source in sources]
    first = infos[0]
    for source, info in zip(sources, infos, strict=True):
        if (info.features, info.fps, info.robot_type) != (first.features, first.fps, first.robot_type):
            raise DatasetError(
                f"{source} and {sources[0]} differ in features or rate: they cannot be one dataset"
            )
    tasks = map(io_utils.load_tasks, sources)
    sentences = list(dict.fromkeys(sentence for of_source in tasks for sentence in of_source.index))
    merger = _Merger(root, sentences, first.chunks_size)
    episodes = pa.concat_tables([merger.add(source) for source in sources])
    path = root / DEFAULT_EPISODES_PATH.format(chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True)
    pq.write_table(episodes, path)
    io_utils.write_tasks(
        pd.DataFrame({"task_index": range(len(sentences))}, index=pd.Index(sentences, name="task")), root
    )
    first.total_episodes, first.total_frames = merger.episodes, merger.rows
    share_files(root, "*.mp4")  # LeRobot joins videos in temporary files, which no other user may read
    first.total_tasks, first.splits = len(sentences), {"train": f"0:{merger.episodes}"}
    io_utils.write_info(first, root)
    statistics = aggregate_stats([stats for source in sources if (stats := io_utils.load_stats(source))])
    # LeRobot's are in the order of a set, which differs between processes.
    io_utils.write_stats({key: dict(sorted(statistics[key].items())) for key in sorted(statistics)}, root)


class _Merger:
    """Takes over data and videos, source by source; sentences are by their new index, `chunk_size` is files per folder."""

    def __init__(self, root: Path, sentences: Sequence[str], chunk_size: int):
        self._root, self._sentences, self._chunk_size = root, sentences, chunk_size
        self._files: Counter[str] = Counter()
        self.episodes = self.rows = 0

    def add(self, source: Path) -> pa.Table:
        """Take over a dataset; returns its table of episodes with the numbers that hold in the new one."""
        paths = sorted(source.glob("meta/episodes/*/*.parquet"))
        table = pa.concat_tables([pq.read_table(path) for path in paths])
        episodes: dict[str, list[Any]] = table.to_pydict()
        for kind in (name.removesuffix(f"/{CHUNK}") for name in episodes if name.endswith(CHUNK)):
            if kind != "meta/episodes":  # all in one file
                self._take_files(source, kind, episodes)
        rows_before = ("dataset_from_index", self.rows), ("dataset_to_index", self.rows)
        for name, shift in (("episode_index", self.episodes), *rows_before):
            episodes[name] = [number + shift for number in episodes[name]]
        for name in (CHUNK, FILE):
            episodes[f"meta/episodes/{name}"] = [0] * len(table)
        tasks = [float(self._sentences.index(sentence)) for (sentence,) in episodes["tasks"]]
        for statistic in SHIFTED_STATISTICS:  # of the columns that get new numbers
            for column, shift in (("episode_index", self.episodes), ("index", self.rows)):
                name = f"stats/{column}/{statistic}"
                episodes[name] = [[value + shift for value in values] for values in episodes[name]]
            episodes[f"stats/task_index/{statistic}"] = [[task] for task in tasks]
        self.episodes += len(table)
        self.rows += sum(episodes["length"])
        return pa.Table.from_pydict(episodes, table.schema)

    def _take_files(self, source: Path, kind: str, episodes: dict[str, list[Any]]) -> None:
        """Take over the files of a kind, and give the episodes their new numbers."""
        template = DEFAULT_DATA_PATH if kind == "data" else DEFAULT_VIDEO_PATH
        of_episode = list(zip(episodes[f"{kind}/{CHUNK}"], episodes[f"{kind}/{FILE}"], strict=True))
        new = {
            old: divmod(self._files[kind] + number, self._chunk_size)
            for number, old in enumerate(sorted(set(of_episode)))
        }
        self._files[kind] += len(new)
        for place, name in enumerate((CHUNK, FILE)):
            episodes[f"{kind}/{name}"] = [new[old][place] for old in of_episode]
        for pair in new.items():
            old_path, path = (
                folder / template.format(video_key=kind.removeprefix("videos/"), chunk_index=c, file_index=f)
                for folder, (c, f) in zip((source, self._root), pair, strict=True)
            )
            path.parent.mkdir(parents=True, exist_ok=True)
            if kind == "data":
                self._write_rows(source, pq.read_table(old_path), path)
            else:
                _link(old_path, path)

    def _write_rows(self, source: Path, table: pa.Table, path: Path) -> None:
        new_task = np.array([*map(self._sentences.index, io_utils.load_tasks(source).index)])
        values = {
            "episode_index": table["episode_index"].to_numpy() + self.episodes,
            "index": table["index"].to_numpy() + self.rows,
            "task_index": new_task[table["task_index"].to_numpy()],
        }
        for name, numbers in values.items():
            place = table.column_names.index(name)
            field = table.schema.field(place)
            table = table.set_column(place, field, pa.array(numbers, field.type))
        # A key of the `datasets` cache differs each time a table is written.
        described = json.loads(table.schema.metadata[DESCRIPTION])
        described.pop("fingerprint", None)
        metadata = {**table.schema.metadata, DESCRIPTION: json.dumps(described)}
        io_utils.write_table_one_row_group_per_episode(table.replace_schema_metadata(metadata), path)


def _link(old: Path, new: Path) -> None:
    try:
        os.link(old, new)
    except OSError:  # another device, or a file system without links
        shutil.copyfile(old, new)
