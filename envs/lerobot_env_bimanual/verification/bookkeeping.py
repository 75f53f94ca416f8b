"""LeRobot's own columns and tables: by them training finds a row, its images and its sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from lerobot_bimanual.dataset.reader import (
    EPISODE_INDEX,
    FRAME_INDEX,
    INDEX,
    TASK_INDEX,
    TIMESTAMP,
    RecordedEpisode,
    data_file,
    episode_table,
    frames_per_second,
    read_info,
    read_table,
)
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.fault import Fault, first_of

TASKS_FILE = Path("meta", "tasks.parquet")
TIME_S = 1e-6
"""Largest error of a time in the table of episodes; LeRobot takes an image that is up to 1e-4 s off."""

ENTRY = (
    EPISODE_INDEX,
    "tasks",
    "length",
    "data/chunk_index",
    "data/file_index",
    "dataset_from_index",
    "dataset_to_index",
    "meta/episodes/chunk_index",
    "meta/episodes/file_index",
)
VIDEO_ENTRY = ("chunk_index", "file_index", "from_timestamp", "to_timestamp")
"""Columns of the table of episodes, and those of each video, besides statistics."""


class Bookkeeping:
    """What LeRobot's tables say about all episodes.

    Args:
        root: folder of one view.
    """

    def __init__(self, root: Path):
        self._root = root

    @cached_property
    def fps(self) -> int:
        """Rows per second."""
        return frames_per_second(read_info(self._root))

    @cached_property
    def entries(self) -> list[dict[str, Any]]:
        """The table of episodes without statistics, every cell of which is there.

        Raises:
            DatasetError: it is damaged, or a cell is empty.
        """
        table = episode_table(self._root)
        names = [name for name in table.column_names if not name.startswith("stats/")]
        if empty := [name for name in names if table[name].null_count]:
            raise DatasetError(f"the table of episodes is empty in some cells of {', '.join(empty)}")
        if missing := [name for name in ENTRY if name not in names]:
            raise DatasetError(f"the table of episodes lacks {', '.join(missing)}")
        return table.select(names).to_pylist()

    @cached_property
    def sentences(self) -> list[Any]:
        """The sentences in the order in which LeRobot numbers them."""
        return read_table(self._root / TASKS_FILE, columns=["task"])["task"].to_pylist()

    def check_rows(self, episode: RecordedEpisode) -> Iterator[Fault]:
        """Time, numbers and sentence of every row of an episode."""
        entry, rows = self.entries[episode.index], np.arange(len(episode))
        wanted = {
            TIMESTAMP: (rows / self.fps).astype(np.float32),
            FRAME_INDEX: rows,
            EPISODE_INDEX: np.full(len(rows), episode.index),
            INDEX: entry["dataset_from_index"] + rows,
        }
        for key, values in wanted.items():
            yield from first_of(episode.bookkeeping[key] != values, f"{key} is not that of its row")
        numbers = episode.bookkeeping[TASK_INDEX]
        known = (numbers >= 0) & (numbers < len(self.sentences))
        said = [
            number
            for number in np.unique(numbers[known])
            if self.sentences[number] != episode.meta.instruction
        ]
        yield from first_of(
            ~known | np.isin(numbers, said), f"task_index does not lead to {episode.meta.instruction!r}"
        )


def check_sentences(root: Path) -> Iterator[Fault]:
    """`meta/tasks.parquet` lists the sentences of the episodes in the order of their first use, each once."""
    table = read_table(root / TASKS_FILE)
    if set(table.column_names) != {"task_index", "task"}:
        yield Fault(f"{TASKS_FILE} has the columns {table.column_names}, not task_index and task")
        return
    used = dict.fromkeys(_sentence(entry) for entry in Bookkeeping(root).entries)
    found = list(zip(table["task_index"].to_pylist(), table["task"].to_pylist(), strict=True))
    if found != list(enumerate(used)):
        yield Fault(f"{TASKS_FILE} holds {found[:10]}, but the episodes use {list(enumerate(used))[:10]}")


def check_entries(root: Path) -> Iterator[Fault]:
    """Every entry of the table of episodes follows the one before it, in rows and in the time of its videos."""
    info, books = read_info(root), Bookkeeping(root)
    videos = [key for key, feature in info["features"].items() if feature["dtype"] == "video"]
    wanted = {*ENTRY, *(f"videos/{key}/{part}" for key in videos for part in VIDEO_ENTRY)}
    if books.entries[0].keys() != wanted:
        yield Fault(
            f"the columns of meta/episodes differ from LeRobot's by {sorted(books.entries[0].keys() ^ wanted)}"
        )
        return
    row = 0
    ends_s: dict[tuple[Any, ...], float] = {}
    for entry in books.entries:
        place = f"the entry of episode {entry[EPISODE_INDEX]}"
        span = entry["dataset_from_index"], entry["dataset_to_index"]
        if span != (row, row + entry["length"]):
            yield Fault(f"{place} has the rows {span}, not {(row, row + entry['length'])}")
        row += entry["length"]
        for key in videos:
            chunk, file, start_s, end_s = (entry[f"videos/{key}/{part}"] for part in VIDEO_ENTRY)
            expected_s = ends_s.get((key, chunk, file), 0.0)
            ends_s[key, chunk, file] = expected_s + entry["length"] / books.fps
            if not abs(start_s - expected_s) <= TIME_S or not abs(end_s - ends_s[key, chunk, file]) <= TIME_S:
                yield Fault(
                    f"{place} lets {key} last from {start_s} to {end_s} s, not from {expected_s:.3f} to "
                    f"{ends_s[key, chunk, file]:.3f} s"
                )


def check_entry_files(root: Path) -> Iterator[Fault]:
    """Every file of the table of episodes says of its episodes that they stand in it, in order."""
    names = ["meta/episodes/chunk_index", "meta/episodes/file_index"]
    numbers: list[Any] = []
    for path in sorted(root.glob("meta/episodes/*/*.parquet")):
        table = read_table(path, columns=[EPISODE_INDEX, *names])
        numbers += table[EPISODE_INDEX].to_pylist()
        for entry in table.to_pylist():
            place = f"meta/episodes/chunk-{entry[names[0]]:03d}/file-{entry[names[1]]:03d}.parquet"
            if place != path.relative_to(root).as_posix():
                yield Fault(
                    f"{path.relative_to(root)} says that episode {entry[EPISODE_INDEX]} stands in {place}"
                )
                break
    if numbers != list(range(len(numbers))):
        yield Fault(f"the files of meta/episodes hold the episodes in the order {numbers[:10]}")


def check_order(root: Path) -> Iterator[Fault]:
    """All files of rows, one after the other as LeRobot reads them, hold the rows of the episodes and no other."""
    info, entries = read_info(root), Bookkeeping(root).entries
    paths = sorted(root.glob("data/*/*.parquet"))
    lengths = [entry["length"] for entry in entries]
    total = sum(lengths)
    rows = sum(_row_count(path) for path in paths)
    if rows != total:
        yield Fault(f"the files of rows hold {rows} rows, but the table of episodes has {total}")
        return  # they may be too many to be read
    tables = [read_table(path, columns=[EPISODE_INDEX, INDEX]).cast(_NUMBERS) for path in paths]
    episodes, index = (
        np.concatenate([np.asarray(table[key]) for table in tables]) for key in (EPISODE_INDEX, INDEX)
    )
    for name, found, wanted in (
        (EPISODE_INDEX, episodes, np.repeat(np.arange(len(lengths)), lengths)),
        (INDEX, index, np.arange(total)),
    ):
        if len(wrong := np.flatnonzero(found != wanted)):
            row = wrong[0]
            yield Fault(f"row {row} of all files has the {name} {found[row]}, not {wanted[row]}")
    files = np.repeat([str(path) for path in paths], [len(table) for table in tables])
    for number, first in enumerate(np.cumsum([0, *lengths[:-1]])):
        path = data_file(root, info, entries[number])
        if files[first] != str(path):
            yield Fault(f"episode {number} is said to stand in {path.relative_to(root)}, but does not")


BOOKKEEPING_CHECKS: dict[str, Callable[[Path], Iterator[Fault]]] = {
    "sentences": check_sentences,
    "table of episodes": check_entries,
    "files of episodes": check_entry_files,
    "order of rows": check_order,
}

_NUMBERS = pa.schema([(EPISODE_INDEX, pa.int64()), (INDEX, pa.int64())])


def _row_count(path: Path) -> int:
    try:
        return pq.read_metadata(path).num_rows
    except (pa.ArrowException, OSError) as error:
        raise DatasetError(f"{path} is damaged: {error}") from error


def _sentence(entry: dict[str, Any]) -> str:
    tasks = entry["tasks"]
    return tasks[0] if isinstance(tasks, list) and tasks else str(tasks)
