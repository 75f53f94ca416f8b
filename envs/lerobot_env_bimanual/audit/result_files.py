"""Files of results, and the episodes in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode


def result_files(results: Path) -> list[Path]:
    """The file, or the files of a folder.

    Raises:
        BimanualError: a folder without results.
    """
    if not results.is_dir():
        return [results]
    found = sorted(results.glob("*.json"))
    if not found:
        raise BimanualError(f"{results} holds no results; `lerobot-bimanual benchmark` writes them")
    return found


def drawn(episodes: tuple[PlayedEpisode, ...], count: int, rng: np.random.Generator) -> list[PlayedEpisode]:
    """So many episodes at random, in their order; all if `count` is 0 or beyond their number."""
    if not 0 < count < len(episodes):
        return list(episodes)
    return [episodes[index] for index in sorted(rng.choice(len(episodes), count, replace=False))]
