"""Checks of an episode's columns that need no simulation: which episode it is, and LeRobot's own columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.provenance import EpisodeKey
from lerobot_bimanual.dataset.reader import (
    EPISODE_INDEX,
    FRAME_INDEX,
    INDEX,
    TASK_INDEX,
    TIMESTAMP,
    RecordedDataset,
    RecordedEpisode,
)
from lerobot_env_bimanual.options import SPLITS
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.verification.fault import Fault, first_of


def check_key(dataset: RecordedDataset, episode: RecordedEpisode) -> Iterator[Fault]:
    """Task, variation, split and seed are the same in every row, exist, and are those that the dataset lists."""
    for key in (schema.TASK_NAME, schema.VARIATION, schema.SPLIT, schema.SEED):
        column = episode.columns[key]
        yield from first_of(column != column[0], f"{key} changes within the episode")
    meta = episode.meta
    if meta.split not in SPLITS or meta.seed < 0:
        yield Fault(f"there is no seed {meta.seed} of the split {meta.split!r}")
        return
    spec = get_task(meta.task).spec
    spec.variation_index(meta.variation)
    sentences = spec.instructions_for(spec.variations[meta.variation])
    if meta.instruction not in sentences:
        expected = ", ".join(map(repr, sentences))
        yield Fault(f"the instruction is {meta.instruction!r}, but the task has {expected}")
    listed = dataset.provenance.episodes if dataset.provenance is not None else ()
    found = EpisodeKey(task=meta.task, variation=meta.variation, split=meta.split, seed=meta.seed)
    if episode.index < len(listed) and listed[episode.index] != found:
        yield Fault(f"it holds {found}, but the dataset lists {listed[episode.index]}")


def check_bookkeeping(
    episode: RecordedEpisode, entry: dict[str, Any], sentences: Sequence[str], fps: int
) -> Iterator[Fault]:
    """Time, numbers and sentence of every row, by which training finds it.

    Args:
        episode: its columns.
        entry: its row in the table of episodes.
        sentences: all sentences in the order in which LeRobot numbers them.
        fps: rows per second.
    """
    rows = np.arange(len(episode))
    numbers = [number for number, text in enumerate(sentences) if text == episode.meta.instruction]
    wanted = {
        TIMESTAMP: (rows / fps).astype(np.float32),
        FRAME_INDEX: rows,
        EPISODE_INDEX: np.full(len(rows), episode.index),
        INDEX: entry["dataset_from_index"] + rows,
        TASK_INDEX: np.full(len(rows), numbers[0] if len(numbers) == 1 else -1),
    }
    for key, values in wanted.items():
        yield from first_of(episode.bookkeeping[key] != values, f"{key} is not that of its row")
