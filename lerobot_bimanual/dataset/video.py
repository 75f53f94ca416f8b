"""Video encoding in the calling thread: no queue that could drop a frame, one core, the same bytes every time.

LeRobot's own streaming encoder is made for live recording. It drops frames with a warning when an encoder falls
behind, and it spends more time on image statistics than on encoding (12 ms per 256x256 RGB frame, measured,
against 2 ms). This one has the same interface, so LeRobot's writer takes it in place of its own.
"""

import contextlib
import tempfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import av.error
import numpy as np
from lerobot.configs.video import DepthEncoderConfig, RGBEncoderConfig
from lerobot.datasets.compute_stats import RunningQuantileStats
from lerobot.datasets.depth_utils import quantize_depth
from lerobot.datasets.pyav_utils import write_u16_plane
from lerobot.datasets.video_utils import StreamingVideoEncoder
from numpy.typing import NDArray

from lerobot_bimanual.dataset.schema import DEPTH_MAX_M, DEPTH_MIN_M
from lerobot_bimanual.joint_action import CONTROL_HZ

TICK = Fraction(1, CONTROL_HZ)

STATISTICS_EVERY = 10
"""Image statistics are estimated from every tenth frame and every second pixel in both directions."""


def rgb_encoder() -> RGBEncoderConfig:
    """H.264 that any browser plays, visually lossless; every other frame decodes without its neighbours.

    The macroblock tree is off: for small frames x264 reads it from uninitialised memory, so that equal frames
    sometimes give different bytes; with groups of two frames there is nothing to plan ahead.
    """
    return RGBEncoderConfig(
        vcodec="h264",
        pix_fmt="yuv420p",
        g=2,
        crf=18,
        preset="veryfast",
        extra_options={"x264-params": "mbtree=0"},
    )


def depth_encoder() -> DepthEncoderConfig:
    """Lossless 12-bit HEVC over the schema's depth range.

    Measured at 256x256: 2.1 ms and 9 kB per frame of a fixed camera, 3.6 ms and 16 kB of one that moves with a hand, for
    which x265 takes 3.2 and 6.3 ms where it may choose blocks larger than 16 pixels, to save 5 % of the size.
    """
    x265 = "lossless=1:ctu=16:rd=1:pools=none:frame-threads=1:bframes=0:rc-lookahead=0:log-level=error"
    return DepthEncoderConfig(
        preset="ultrafast",
        g=10,
        extra_options={"x265-params": x265},
        depth_min=DEPTH_MIN_M,
        depth_max=DEPTH_MAX_M,
        use_log=False,
    )


class EpisodeVideoEncoder(StreamingVideoEncoder):
    """Encodes the frames of one episode as they come, one file per camera stream."""

    def __init__(self):
        super().__init__(CONTROL_HZ)
        scale = {"depth_min": DEPTH_MIN_M, "depth_max": DEPTH_MAX_M, "use_log": False}
        # (65536,) stored code of every depth in millimetres
        codes = quantize_depth(np.arange(2**16, dtype=np.uint16), video_backend=None, **scale)
        self._depth_codes = np.asarray(codes)
        self._streams: dict[str, _Stream] = {}

    def start_episode(
        self, video_keys: list[str], temp_dir: Path, depth_video_keys: list[str] | None = None
    ) -> None:
        """Open one file per key in a folder of its own below `temp_dir`."""
        self.cancel_episode()
        for key in video_keys:
            codes = self._depth_codes if key in (depth_video_keys or []) else None
            config = rgb_encoder() if codes is None else depth_encoder()
            path = Path(tempfile.mkdtemp(dir=temp_dir)) / f"{key}.mp4"
            self._streams[key] = _Stream(path, config, codes)

    def feed_frame(self, video_key: str, image: NDArray) -> None:
        """Encode an RGB uint8 (H, W, 3) or a depth uint16 (H, W, 1) frame in millimetres."""
        self._streams[video_key].add(image)

    def finish_episode(self) -> dict[str, tuple[Path, dict | None]]:
        """Finish all files; per key its path and statistics per channel."""
        results = {key: (stream.path, stream.close()) for key, stream in self._streams.items()}
        self._streams.clear()
        return results

    def cancel_episode(self) -> None:
        """Give up the files of the running episode, if there is one; the caller removes the folder."""
        for stream in self._streams.values():
            stream.abandon()
        self._streams.clear()

    close = cancel_episode


class _Stream:
    """One camera stream of one episode."""

    def __init__(self, path: Path, config: RGBEncoderConfig | DepthEncoderConfig, codes: NDArray | None):
        self.path = path
        self._config = config
        self._codes = codes
        self._container: Any = av.open(str(path), "w")
        self._video: Any = None
        self._statistics = RunningQuantileStats()
        self._frames = 0

    def add(self, image: NDArray) -> None:
        if self._video is None:
            self._video = self._container.add_stream(
                self._config.vcodec, CONTROL_HZ, options=self._config.get_codec_options(1, as_strings=True)
            )
            self._video.pix_fmt = self._config.pix_fmt
            self._video.height, self._video.width = image.shape[:2]
            self._video.time_base = TICK
        frame = self._to_frame(image)
        frame.pts = self._frames
        frame.time_base = TICK
        self._container.mux(self._video.encode(frame))
        if self._frames % STATISTICS_EVERY == 0:
            self._statistics.update(image[::2, ::2].reshape(-1, image.shape[-1]))
        self._frames += 1

    def close(self) -> dict | None:
        if self._video is not None:
            self._container.mux(self._video.encode())
        self._container.close()
        return self._statistics.get_statistics() if self._frames else None

    def abandon(self) -> None:
        with contextlib.suppress(av.error.FFmpegError):  # the reason for giving up may well be a broken file
            self._container.close()

    def _to_frame(self, image: NDArray) -> av.VideoFrame:
        if self._codes is None:
            return av.VideoFrame.from_ndarray(image, format="rgb24")
        frame = av.VideoFrame(image.shape[1], image.shape[0], self._config.pix_fmt)
        write_u16_plane(frame.planes[0], self._codes.take(image[..., 0]), fill_value=0)
        return frame
