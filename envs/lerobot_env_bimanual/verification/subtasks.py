"""Checks of what a dataset says in words about each stage, in the columns that LeRobot keeps for language."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import read_info
from lerobot_env_bimanual.verification.fault import Fault

SUBTASKS, EVENTS = "language_persistent", "language_events"
LANGUAGE_FEATURES = {key: {"dtype": "language", "shape": (1,), "names": None} for key in (SUBTASKS, EVENTS)}
"""LeRobot's feature table of its language columns, which a dataset has both or none of."""


def check_subtasks(root: Path) -> Iterator[Fault]:
    """Where there are language columns: every row of an episode lists the same subtasks, one for each keypose.

    A subtask begins in the row in which its keypose becomes the next one. There are no events, and nothing in words that
    is no subtask.
    """
    if SUBTASKS not in read_info(root)["features"]:
        return
    columns = ["episode_index", "timestamp", schema.KEYPOSE_STEP, SUBTASKS, EVENTS]
    for path in sorted(root.glob("data/*/*.parquet")):
        table = pq.read_table(path, columns=columns)
        episodes, times_s, steps = (np.array(table[key]) for key in columns[:3])
        words, events = table[SUBTASKS].to_pylist(), table[EVENTS].to_pylist()
        for episode in np.unique(episodes):
            rows = np.flatnonzero(episodes == episode)
            place = f"episode {episode}"
            if any(events[row] for row in rows):
                yield Fault(f"{place} has {EVENTS}, which nobody here writes")
            subtasks = words[rows[0]]
            if any(words[row] != subtasks for row in rows):
                yield Fault(f"{place} has other subtasks in some rows than in its first")
            elif fault := _wrong(subtasks, _begins_s(times_s[rows], steps[rows])):
                yield Fault(f"{place}: {fault}")


def _begins_s(times_s: NDArray, steps: NDArray) -> NDArray:
    """When each keypose became the next one; in an episode's last row there is none any more."""
    _, first = np.unique(steps[:-1], return_index=True)
    return times_s[first]


def _wrong(subtasks: list[dict[str, Any]] | None, begins_s: NDArray) -> str:
    """What is wrong with an episode's subtasks; "" if nothing is."""
    if not subtasks or len(subtasks) != len(begins_s):
        return f"{len(subtasks or ())} subtasks for {len(begins_s)} keyposes"
    for subtask, begin_s in zip(subtasks, begins_s, strict=True):
        if (subtask["role"], subtask["style"]) != ("assistant", "subtask") or not subtask["content"]:
            return f"{subtask} is no subtask in words"
        if np.float32(subtask["timestamp"]) != np.float32(begin_s):
            return f"{subtask['content']!r} begins at {subtask['timestamp']:g} s, but its keypose at {begin_s:g} s"
    return ""
