"""Stored images of some rows beside new ones of the same ticks, rendered from the episode as it was played again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedEpisode
from lerobot_bimanual.episode import Episode
from lerobot_bimanual.keypose import POSITION
from lerobot_env_bimanual.verification.fault import Fault
from lerobot_env_bimanual.verification.video import AFTER, BEFORE, VideoComparison

RGB, DEPTH = "rendered RGB", "rendered depth"

ALL_ROWS = -1
FASTEST = 0.1
"""Share of an episode's rows from which one is drawn where the hands move fastest: there neighbouring images differ."""


def draw_rows(episode: RecordedEpisode, count: int, seed: int, in_pairs: bool = False) -> list[int]:
    """Rows whose images are compared, ascending.

    Args:
        episode: its columns.
        count: number of rows, `ALL_ROWS` for all.
        seed: of the draw, together with the episode's index.
        in_pairs: whether the first two are neighbours where the hands move fast, so that a video can be told from one
            that is a tick late.
    """
    rows = len(episode)
    if count == ALL_ROWS or count >= rows:
        return list(range(rows))
    rng = np.random.default_rng([seed, episode.index])
    drawn: list[int] = []
    if in_pairs and count >= 2:
        steps = np.argsort(_speeds(episode), kind="stable")
        first = int(rng.choice(steps[-max(1, round(FASTEST * len(steps))) :]))
        drawn = [first, first + 1]
    others = [row for row in range(rows) if row not in drawn]
    return sorted([*drawn, *rng.choice(others, count - len(drawn), replace=False).tolist()])


class RenderedRows:
    """Compares stored images with new ones, row by row.

    Depth and images in tables have to be equal to the pixel. Colours of videos have lost a little: every frame has to
    be like the new image, and over the frames whose neighbours are compared, too, more like it than like theirs.

    Args:
        episode: as it is stored.
        played: as it was played again.
        rows: that are compared.
        is_video: whether colours are stored as video.
    """

    def __init__(self, episode: RecordedEpisode, played: Episode, rows: Iterable[int], is_video: bool):
        ticks = episode.columns[schema.TICK].tolist()
        self._new = {
            row: _as_stored(played.images(ticks[row])) for row in rows if 0 <= ticks[row] < played.rows
        }
        self._is_video = is_video
        self._videos: dict[str, VideoComparison] = {}
        self._found: dict[str, list[Fault]] = {RGB: [], DEPTH: []}

    def see(self, key: str, row: int, image: NDArray) -> None:
        """Compare the image of a row, if it is one of those."""
        if row not in self._new:
            return
        new = self._new[row][key]
        if image.dtype == np.uint16:
            if (error_mm := int(np.abs(image.astype(np.int32) - new).max())) > 0:
                self._found[DEPTH].append(Fault(f"{key} is wrong by up to {error_mm} mm", row))
        elif self._is_video:
            self._see_frame(key, row, image)
        elif not np.array_equal(image, new):
            pixels = (image != new).any(axis=-1).sum()
            self._found[RGB].append(Fault(f"{key} differs from a new image in {pixels} pixels", row))

    def faults(self) -> dict[str, tuple[Fault, ...]]:
        """What differs, by check, after the last row; of each check the first fault only."""
        whole = [fault for video in self._videos.values() for fault in video.faults()]
        self._found[RGB][:0] = whole  # they explain what is wrong with single frames
        return {name: tuple(found[:1]) for name, found in self._found.items()}

    def _see_frame(self, key: str, row: int, image: NDArray[np.uint8]) -> None:
        video = self._videos.setdefault(key, VideoComparison(key))
        self._found[RGB].extend(video.frame_faults(image, self._new[row][key], row))
        near = {BEFORE: row - 1, AFTER: row + 1}
        neighbours = {name: self._new[other][key] for name, other in near.items() if other in self._new}
        if neighbours:
            video.add(image, self._new[row][key], neighbours)


def _as_stored(images: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Images of the environment as a dataset stores them: depth in whole millimetres."""
    return {
        key: image if image.dtype == np.uint8 else schema.stored_depth(image[0])
        for key, image in images.items()
    }


def _speeds(episode: RecordedEpisode) -> NDArray[np.float64]:
    """(rows - 1,) how far the hands go from each row to the next."""
    hands = (
        episode.columns[schema.EE_POSE].astype(np.float64).reshape(len(episode), len(ARMS), -1)[..., POSITION]
    )
    return np.linalg.norm(np.diff(hands, axis=0), axis=-1).sum(axis=1)
