"""Decodes the images of a dataset, one after the other, from videos or from tables."""

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import av.error
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_bimanual.dataset.reader import episode_table, read_info, read_table
from lerobot_bimanual.errors import DatasetError

DEPTH_CODES = 2**12


class ImageReader:
    """The images of a dataset in stored order; holds one at a time.

    Attributes:
        root: folder of one view.
        shapes: key of each image -> (height, width, channels); depth has one channel.
    """

    def __init__(self, root: str | Path):
        self.root = Path(root)
        self._info = read_info(self.root)
        features = self._info["features"]
        self._images: dict[str, dict[str, Any]] = {
            key: feature for key, feature in features.items() if feature["dtype"] in ("video", "image")
        }
        self.shapes: dict[str, tuple[int, ...]] = {k: tuple(f["shape"]) for k, f in self._images.items()}
        self._videos = [key for key, feature in self._images.items() if feature["dtype"] == "video"]
        places = ["episode_index", "data/chunk_index", "data/file_index"]
        for key in self._videos:
            places += [f"videos/{key}/{part}" for part in ("chunk_index", "file_index", "from_timestamp")]
        self._episodes = episode_table(self.root, places).to_pylist()
        self._spans = {key: self._frame_spans(key) for key in self._videos}

    def is_depth(self, key: str) -> bool:
        """Whether a key's images are depth."""
        return bool((self._images[key].get("info") or {}).get("is_depth_map"))

    def images(self, episode: int, key: str) -> Iterator[NDArray]:
        """All stored images of one episode and key, however many rows the episode has.

        Yields:
            RGB uint8 (height, width, 3), or depth uint16 (height, width) in millimetres.

        Raises:
            DatasetError: an image is missing or cannot be decoded.
        """
        return (self._from_video if key in self._videos else self._from_table)(episode, key)

    def _from_video(self, episode: int, key: str) -> Iterator[NDArray]:
        path = self._video_path(self._episodes[episode], key)
        first, end = self._spans[key][episode]
        millimetres = self._millimetres(key) if self.is_depth(key) else None
        try:
            with av.open(str(path)) as container:
                stream = container.streams.video[0]
                assert stream.time_base is not None
                container.seek(int(first / self._info["fps"] / stream.time_base), stream=stream)
                for frame in container.decode(stream):
                    number = round((frame.time or 0.0) * self._info["fps"])
                    if number >= end:
                        return
                    if number >= first:
                        yield _rgb(frame) if millimetres is None else millimetres[_codes(frame)]
        except (OSError, IndexError, av.error.FFmpegError) as error:
            raise DatasetError(f"cannot decode {path}: {error}") from error

    def _from_table(self, episode: int, key: str) -> Iterator[NDArray]:
        entry = self._episodes[episode]
        path = self.root / self._info["data_path"].format(
            chunk_index=entry["data/chunk_index"], file_index=entry["data/file_index"]
        )
        column = read_table(path, columns=[key], filters=[("episode_index", "=", episode)])[key]
        for row, cell in enumerate(column):
            content = (cell.as_py() or {}).get("bytes")
            if not content:
                raise DatasetError(f"row {row} of {key} in {path} has no image")
            try:
                yield np.asarray(Image.open(io.BytesIO(content)))
            except OSError as error:
                raise DatasetError(f"cannot decode row {row} of {key} in {path}: {error}") from error

    def _video_path(self, entry: dict[str, Any], key: str) -> Path:
        chunk, file = entry[f"videos/{key}/chunk_index"], entry[f"videos/{key}/file_index"]
        return self.root / self._info["video_path"].format(video_key=key, chunk_index=chunk, file_index=file)

    def _frame_spans(self, key: str) -> list[tuple[int, float]]:
        """Per episode, its first frame in its file and the next episode's; infinite at the end of the file."""
        starts = [
            round(entry[f"videos/{key}/from_timestamp"] * self._info["fps"]) for entry in self._episodes
        ]
        paths = [self._video_path(entry, key) for entry in self._episodes]
        in_file: dict[Path, list[int]] = {}
        for path, start in zip(paths, starts, strict=True):
            in_file.setdefault(path, []).append(start)
        following = {
            (path, start): after
            for path, found in in_file.items()
            for start, after in zip(sorted(found), [*sorted(found)[1:], math.inf], strict=True)
        }
        return [(start, following[path, start]) for path, start in zip(paths, starts, strict=True)]

    def _millimetres(self, key: str) -> NDArray[np.uint16]:
        """Depth (4096,) of every stored code."""
        from lerobot.datasets.depth_utils import dequantize_depth

        info = self._images[key]["info"]
        options = {name: info[f"video.{name}"] for name in ("depth_min", "depth_max", "shift", "use_log")}
        codes = np.arange(DEPTH_CODES, dtype=np.uint16)[None]
        return np.asarray(dequantize_depth(codes, output_tensor=False, **options), np.uint16).ravel()


def _rgb(frame: av.VideoFrame) -> NDArray[np.uint8]:
    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


def _codes(frame: av.VideoFrame) -> NDArray[np.uint16]:
    return np.asarray(frame.to_ndarray(format="gray12le"), np.uint16)
