"""Writes videos of episodes as mp4 files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.joint_action import CONTROL_HZ

CRF = "20"
"""Constant rate factor of H.264: visually clean at about 100 kB per second of video."""


class VideoWriter:
    """Writes frames to an H.264 file that appears under its name only when it is complete.

    Args:
        folder: created if absent.
        stem: beginning of the file name; `close` adds the outcome.
    """

    def __init__(self, folder: Path, stem: str):
        self._folder = folder
        self._stem = stem
        self._container: Any = None
        self._stream: Any = None

    @property
    def _partial(self) -> Path:
        return self._folder / f".{self._stem}.part"

    def add(self, rgb: NDArray[np.uint8]) -> None:
        """Append a frame, uint8 (H, W, 3); even sides, as chroma is stored at half resolution.

        Raises:
            BimanualError: the file cannot be written.
        """
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

    def close(self, outcome: str) -> Path | None:
        """Finish the file as `<stem>_<outcome>.mp4`, replacing an older one of that name.

        Returns:
            Its path, or `None` if no frame was written.

        Raises:
            BimanualError: the file cannot be written.
        """
        if self._container is None:
            return None
        container, self._container = self._container, None
        with self._plain_errors():
            container.mux(self._stream.encode(None))
            container.close()
            return self._partial.replace(self._folder / f"{self._stem}_{outcome}.mp4")

    @contextmanager
    def _plain_errors(self) -> Iterator[None]:
        """Say in words that a file cannot be written; PyAV's errors about files are OSErrors, too."""
        try:
            yield
        except OSError as error:
            raise BimanualError(f"cannot write videos to {self._folder}: {error}") from error
