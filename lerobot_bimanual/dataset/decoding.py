"""Decodes the images of a dataset, one after the other, from videos or from tables.

An image is looked at before it is decoded: one of another size than the dataset declares is refused, so that a few
bytes of a stranger cannot claim gigabytes of memory.
"""

import io
import math
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import av
import av.error
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_bimanual.dataset.reader import (
    IMAGE_TYPES,
    data_file,
    episode_table,
    frames_per_second,
    is_depth,
    read_info,
    read_table,
    video_file,
)
from lerobot_bimanual.errors import DatasetError

DEPTH_CODES = 2**12
MAX_SIDE = 2**13
"""Pixels; no dataset of ours has larger images."""

MAX_FILE_BYTES = 2**28
"""Of one image in a table, a header of it included."""

FORMATS = ("PNG", "TIFF")
"""What LeRobot stores in tables; Pillow's readers of all other formats stay closed."""


class ImageReader:
    """The images of a dataset in stored order; holds one at a time.

    Attributes:
        root: folder of one view.
        shapes: key of each image -> (height, width, channels); depth has one channel.

    Raises:
        DatasetError: the dataset's metadata do not say where its images are.
    """

    def __init__(self, root: str | Path):
        self.root = Path(root)
        self._info = read_info(self.root)
        features = self._info["features"]
        self._images: dict[str, dict[str, Any]] = {
            key: feature for key, feature in features.items() if feature["dtype"] in IMAGE_TYPES
        }
        self.shapes: dict[str, tuple[int, ...]] = {k: tuple(f["shape"]) for k, f in self._images.items()}
        if large := [key for key, shape in self.shapes.items() if max(shape) > MAX_SIDE]:
            raise DatasetError(f"{', '.join(large)} would be larger than {MAX_SIDE} pixels")
        self._videos = [key for key, feature in self._images.items() if feature["dtype"] == "video"]
        self._fps = frames_per_second(self._info)
        places = ["episode_index", "data/chunk_index", "data/file_index"]
        for key in self._videos:
            places += [f"videos/{key}/{part}" for part in ("chunk_index", "file_index", "from_timestamp")]
        self._episodes = episode_table(self.root, places).to_pylist()
        self._spans = {key: self._frame_spans(key) for key in self._videos}

    def is_depth(self, key: str) -> bool:
        """Whether a key's images are depth."""
        return is_depth(self._images[key])

    @property
    def units(self) -> dict[str, object]:
        """Rows per second, and the unit in which each depth image is stored."""
        depth = {
            key: image["info"].get("depth_unit") for key, image in self._images.items() if is_depth(image)
        }
        return {"fps": self._fps, **depth}

    def images(self, episode: int, key: str) -> Iterator[NDArray]:
        """All stored images of one episode and key, however many rows the episode has.

        Yields:
            RGB uint8 (height, width, 3), or depth uint16 (height, width) in millimetres.

        Raises:
            DatasetError: an image is missing, has another size than declared, or cannot be decoded.
        """
        return (self._from_video if key in self._videos else self._from_table)(episode, key)

    def _from_video(self, episode: int, key: str) -> Iterator[NDArray]:
        path = video_file(self.root, self._info, self._episodes[episode], key)
        first, end = self._spans[key][episode]
        millimetres = self._millimetres[key] if self.is_depth(key) else None
        try:
            with av.open(str(path), format="mp4") as container:  # no playlist, which leads elsewhere
                stream = container.streams.video[0]
                _check_size(f"{key} in {path}", (stream.height, stream.width), self.shapes[key])
                assert stream.time_base is not None
                container.seek(int(first / self._fps / stream.time_base), stream=stream)
                for frame in container.decode(stream):
                    number = round((frame.time or 0.0) * self._fps)
                    if number >= end:
                        return
                    if number >= first:
                        yield _rgb(frame) if millimetres is None else millimetres[_codes(frame)]
        except (OSError, IndexError, ValueError, OverflowError, av.error.FFmpegError) as error:
            raise DatasetError(f"cannot decode {path}: {error}") from error

    def _from_table(self, episode: int, key: str) -> Iterator[NDArray]:
        path = data_file(self.root, self._info, self._episodes[episode])
        column = read_table(path, columns=[key], filters=[("episode_index", "=", episode)])[key]
        for row, cell in enumerate(column):
            value = cell.as_py()
            content = value.get("bytes") if isinstance(value, dict) else None
            if not isinstance(content, bytes) or not content:
                raise DatasetError(f"row {row} of {key} in {path} has no image")
            yield self._decoded(content, key, f"row {row} of {key} in {path}")

    def _decoded(self, content: bytes, key: str, place: str) -> NDArray:
        if len(content) > MAX_FILE_BYTES:
            raise DatasetError(f"{place} has {len(content)} bytes, more than any image of ours")
        try:
            image = Image.open(io.BytesIO(content), formats=FORMATS)
            _check_size(place, image.size[::-1], self.shapes[key])
            return np.asarray(image)
        except DatasetError:
            raise
        except Exception as error:  # Pillow's readers of damaged bytes raise nearly anything
            raise DatasetError(f"cannot decode {place}: {error}") from error

    def _frame_spans(self, key: str) -> list[tuple[int, float]]:
        """Per episode, its first frame in its file and the next episode's; infinite at the end of the file."""
        starts = [self._first_frame(entry, key) for entry in self._episodes]
        paths = [video_file(self.root, self._info, entry, key) for entry in self._episodes]
        in_file: dict[Path, list[int]] = {}
        for path, start in zip(paths, starts, strict=True):
            in_file.setdefault(path, []).append(start)
        following = {
            (path, start): after
            for path, found in in_file.items()
            for start, after in zip(sorted(found), [*sorted(found)[1:], math.inf], strict=True)
        }
        return [(start, following[path, start]) for path, start in zip(paths, starts, strict=True)]

    def _first_frame(self, entry: dict[str, Any], key: str) -> int:
        start_s = entry[f"videos/{key}/from_timestamp"]
        if not isinstance(start_s, float) or not 0 <= start_s < 1e9:
            raise DatasetError(f"the table of episodes lets a video of {key} begin at {start_s} s")
        return round(start_s * self._fps)

    @cached_property
    def _millimetres(self) -> dict[str, NDArray[np.uint16]]:
        """Key of each depth video -> depth (4096,) of every stored code."""
        from lerobot.datasets.depth_utils import dequantize_depth

        tables = {}
        codes = np.arange(DEPTH_CODES, dtype=np.uint16)[None]
        for key in filter(self.is_depth, self._videos):
            info = self._images[key]["info"]
            options = {
                name: info.get(f"video.{name}") for name in ("depth_min", "depth_max", "shift", "use_log")
            }
            try:
                depth = dequantize_depth(codes, output_tensor=False, **options)
            except (TypeError, ValueError) as error:
                raise DatasetError(f"{key} is coded with {options}, which cannot be: {error}") from error
            tables[key] = np.asarray(depth, np.uint16).ravel()
        return tables


def _check_size(place: str, found: tuple[int, ...], shape: tuple[int, ...]) -> None:
    if found != shape[:2]:
        raise DatasetError(f"{place} has the shape {found}, not {shape[:2]}")


def _rgb(frame: av.VideoFrame) -> NDArray[np.uint8]:
    return np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)


def _codes(frame: av.VideoFrame) -> NDArray[np.uint16]:
    return np.asarray(frame.to_ndarray(format="gray12le"), np.uint16)
