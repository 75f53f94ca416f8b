"""Whether a video shows the right image at the right tick, in the right colours."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from lerobot_env_bimanual.verification.fault import Fault

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
