"""Writes videos of episodes as mp4 files."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.joint_action import CONTROL_HZ

CRF = "20"
"""Constant rate factor of H.264: visually clean at about 100 kB per second of video."""
HOLD_S = 1.0
"""For which the last frame stays."""
LETTERS_PX = 14
PAPER = (24, 26, 30)
INK = {"success": (96, 214, 130), "failure": (255, 118, 110)}
"""Colour of a caption by the outcome that it names; others are white."""


def captioned(rgb: NDArray[np.uint8], caption: str, outcome: str = "") -> NDArray[np.uint8]:
    """A copy of a frame, uint8 (H, W, 3), with a dark line of text along its upper edge."""
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(rgb)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(LETTERS_PX)
    draw.rectangle((0, 0, image.width, LETTERS_PX + 5), fill=PAPER)
    words = f"{caption} - {outcome}" if outcome else caption
    draw.text((6, 2), words, fill=INK.get(outcome, (255, 255, 255)), font=font)
    return np.asarray(image)


class VideoWriter:
    """Writes frames to an H.264 file that appears under its name only when it is complete, and holds its last frame.

    Args:
        folder: created if absent.
        stem: beginning of the file name; `close` adds the outcome.
        caption: of every frame, e.g. the task and the seed; the held one adds the outcome.
    """

    def __init__(self, folder: Path, stem: str, caption: str = ""):
        self._caption = caption
        self._last: NDArray[np.uint8] | None = None
        self._folder, self._stem = folder, stem
        self._partial = folder / f".{stem}.{uuid4().hex}.part"  # another evaluation may write the same video
        self._container: Any = None
        self._stream: Any = None

    def add(self, rgb: NDArray[np.uint8]) -> None:
        """Append a frame, uint8 (H, W, 3); even sides, as chroma is stored at half resolution.

        Raises:
            BimanualError: the file cannot be written.
        """
        self._last = rgb
        self._write(captioned(rgb, self._caption) if self._caption else rgb)

    def _write(self, rgb: NDArray[np.uint8]) -> None:
        import av  # imported only where a video is written

        with self._plain_errors():
            if self._container is None:
                self._folder.mkdir(parents=True, exist_ok=True)
                self._container = av.open(str(self._partial), "w", format="mp4")
                self._stream = self._container.add_stream("libx264", rate=CONTROL_HZ)
                self._stream.height, self._stream.width = rgb.shape[:2]
                self._stream.pix_fmt = "yuv420p"
                self._stream.options = {"crf": CRF, "preset": "veryfast"}
            self._container.mux(self._stream.encode(av.VideoFrame.from_ndarray(rgb, format="rgb24")))

    def close(self, outcome: str, name: str | None = None) -> Path | None:
        """Hold the last frame, and finish the file, replacing an older one of that name.

        Args:
            outcome: what the caption says at the end.
            name: of the file; by default `<stem>_<outcome>.mp4`.

        Returns:
            Its path, or `None` if no frame was written.

        Raises:
            BimanualError: the file cannot be written.
        """
        if self._container is None or self._last is None:
            return None
        held = captioned(self._last, self._caption, outcome) if self._caption else self._last
        for _ in range(round(HOLD_S * CONTROL_HZ)):
            self._write(held)
        container, self._container = self._container, None
        with self._plain_errors():
            container.mux(self._stream.encode(None))
            container.close()
            return self._partial.replace(self._folder / (name or f"{self._stem}_{outcome}.mp4"))

    @contextmanager
    def _plain_errors(self) -> Iterator[None]:
        """Say in words that a file cannot be written; PyAV's errors about files are OSErrors, too."""
        try:
            yield
        except OSError as error:
            self._partial.unlink(missing_ok=True)
            raise BimanualError(f"cannot write videos to {self._folder}: {error}") from error
