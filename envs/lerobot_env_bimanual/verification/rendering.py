"""Compares stored images of some rows with new ones of the same ticks, rendered from the episode as it was played again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.dataset.reader import RecordedEpisode
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.keypose_layout import POSITION
from lerobot_env_bimanual.verification.fault import Fault

RGB, DEPTH = "rendered RGB", "rendered depth"

ALL_ROWS = -1
FASTEST = 0.1
"""Share of an episode's rows from which one is drawn where the hands move fastest: there neighbouring images differ."""


MIN_PSNR_DB = 20.0
"""Least likeness of a decoded frame of H.264 video to a new image.

Measured over twelve episodes of five tasks and all cameras: at least 23.6 dB at 64 pixels, 27.1 at 128 and 31.2 at
256 (there the first 60 ticks only), least where a wrist camera sees little but saturated colours, whose resolution
4:2:0 halves. Over an episode of each task, the video of another camera has frames below 12 dB.
"""

BEFORE, AFTER, SWAPPED = "the tick before", "the tick after", "exchanged red and blue"
RIVAL_SHARE = 0.5
"""What a video must be less like than its own images: the error against it may not be below this share.

No bound for the likeness can tell these: neighbouring ticks reach 33 dB. Over an episode the squared error against
the tick before or after is 4.3 to 21 times the error against the own images, and 36 to 292 times with red and blue
exchanged; for a video one tick late it is 0.05 to 0.23 times (six episodes of three tasks, all cameras, 128 pixels).
"""


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

    def __init__(self, episode: RecordedEpisode, played: Demonstration, rows: Iterable[int], is_video: bool):
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


class VideoComparison:
    """Frames of one video beside new images, of their own and of neighbouring ticks.

    Args:
        key: of the video, for messages.
    """

    def __init__(self, key: str):
        self._key = key
        self._own = 0.0
        self._rivals: dict[str, float] = {}

    def frame_faults(self, stored: NDArray[np.uint8], new: NDArray[np.uint8], row: int) -> Iterator[Fault]:
        """What is wrong with one frame by itself."""
        error = _squared_error(stored, new)
        likeness_db = psnr_db(error / stored.size)
        if likeness_db < MIN_PSNR_DB:
            yield Fault(
                f"{self._key} is unlike a new image: {likeness_db:.1f} dB, least {MIN_PSNR_DB} dB", row
            )

    def add(
        self, stored: NDArray[np.uint8], new: NDArray[np.uint8], neighbours: Mapping[str, NDArray[np.uint8]]
    ) -> None:
        """Take a frame into account for the verdict on the video as a whole.

        Args:
            stored: the frame.
            new: image of its tick.
            neighbours: images of the ticks `BEFORE` and `AFTER`, as far as there are any.
        """
        self._own += _squared_error(stored, new)
        for rival, image in {**neighbours, SWAPPED: new[..., ::-1]}.items():
            self._rivals[rival] = self._rivals.get(rival, 0.0) + _squared_error(stored, image)

    def faults(self) -> Iterator[Fault]:
        """What is wrong with the video as a whole, after its last frame."""
        if not self._rivals:
            return
        rival = min(self._rivals, key=self._rivals.__getitem__)
        if self._rivals[rival] < RIVAL_SHARE * self._own:
            yield Fault(f"{self._key} shows {rival}: it is more like that than like new images")


def psnr_db(mean_squared_error: float) -> float:
    """Peak signal-to-noise ratio of two 8-bit images; infinite if they are equal."""
    return float("inf") if mean_squared_error == 0 else float(10 * np.log10(255**2 / mean_squared_error))


def _squared_error(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    difference = a.astype(np.float32) - b.astype(np.float32)
    return float(np.vdot(difference, difference))


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
