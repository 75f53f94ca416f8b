"""Compares stored images of some rows with new ones of the same ticks, rendered from the episode as it was played again."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any

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

OWN, BEFORE, AFTER, SWAPPED = "its own tick", "the tick before", "the tick after", "exchanged red and blue"
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
        hands = episode.columns[schema.EE_POSE].astype(np.float64).reshape(rows, len(ARMS), -1)[..., POSITION]
        moved_m = np.linalg.norm(np.diff(hands, axis=0), axis=-1).sum(axis=1)  # (rows - 1,)
        steps = np.argsort(moved_m, kind="stable")
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
        new = {row: played.images(ticks[row]) for row in rows if 0 <= ticks[row] < played.rows}
        # As a dataset stores them: depth in whole millimetres.
        self._new: dict[int, dict[str, Any]] = {
            row: {
                key: image if image.dtype == np.uint8 else schema.stored_depth(image[0])
                for key, image in images.items()
            }
            for row, images in new.items()
        }
        self._is_video = is_video
        self._found: dict[str, list[Fault]] = {RGB: [], DEPTH: []}
        # Of each video: squared errors of its frames against new images, by what these show.
        self._errors: dict[str, Counter[str]] = defaultdict(Counter)

    def see(self, key: str, row: int, image: NDArray) -> None:
        """Compare the image of a row, if it is one of those."""
        if row not in self._new:
            return
        new = self._new[row][key]
        if image.dtype == np.uint16:
            if error_mm := int(np.abs(image.astype(np.int32) - new).max()):
                self._found[DEPTH].append(Fault(f"{key} is wrong by up to {error_mm} mm", row))
        elif self._is_video:
            self._see_frame(key, row, image)
        elif pixels := int((image != new).any(axis=-1).sum()):
            self._found[RGB].append(Fault(f"{key} differs from a new image in {pixels} pixels", row))

    def faults(self) -> dict[str, list[Fault]]:
        """What differs, by check, after the last row; of each check the first fault only."""
        for key, errors in self._errors.items():
            own, (rival, least) = errors.pop(OWN), min(errors.items(), key=lambda item: item[1])
            if least < RIVAL_SHARE * own:
                text = f"{key} shows {rival}: it is more like that than like new images"
                self._found[RGB].insert(0, Fault(text))  # it explains what is wrong with single frames
        return {name: found[:1] for name, found in self._found.items()}

    def _see_frame(self, key: str, row: int, image: NDArray[np.uint8]) -> None:
        new = self._new[row][key]
        psnr_db = 10 * np.log10(255**2 * image.size / max(_squared_error(image, new), 1.0))
        if psnr_db < MIN_PSNR_DB:
            text = f"{key} is unlike a new image: {psnr_db:.1f} dB, least {MIN_PSNR_DB} dB"
            self._found[RGB].append(Fault(text, row))
        near = {BEFORE: row - 1, AFTER: row + 1}
        if shown := {name: self._new[other][key] for name, other in near.items() if other in self._new}:
            shown |= {OWN: new, SWAPPED: new[..., ::-1]}
            self._errors[key].update({what: _squared_error(image, other) for what, other in shown.items()})


def _squared_error(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    difference = a.astype(np.float32) - b.astype(np.float32)
    return float(np.vdot(difference, difference))
