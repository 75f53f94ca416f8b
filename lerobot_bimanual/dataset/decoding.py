"""Decodes the images of a dataset, one after the other, from videos or from tables.

An image is looked at before it is decoded: one of another size than the dataset declares is refused, so that a few
bytes of a stranger cannot claim gigabytes of memory.
"""

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import av.error
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lerobot_bimanual.dataset import reader
from lerobot_bimanual.errors import DatasetError

MAX_SIDE = 2**13
"""Pixels; no dataset of ours has larger images."""

PADDING = 64
"""Pixels that a video's decoder may add to each side."""

SPAN = ("from_timestamp", "to_timestamp")
"""Where an episode begins and ends in its video, in seconds."""

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
        info = reader.read_info(self.root)
        self._images: dict[str, dict[str, Any]] = {
            key: each for key, each in info["features"].items() if each["dtype"] in reader.IMAGE_TYPES
        }
        self.shapes: dict[str, tuple[int, ...]] = {k: tuple(f["shape"]) for k, f in self._images.items()}
        if large := [key for key, shape in self.shapes.items() if max(shape) > MAX_SIDE]:
            raise DatasetError(f"{', '.join(large)} would be larger than {MAX_SIDE} pixels")
        self._videos = [key for key, feature in self._images.items() if feature["dtype"] == "video"]
        self._fps = info["fps"]
        places = ["episode_index", "data/chunk_index", "data/file_index"]
        for key in self._videos:
            places += [f"videos/{key}/{part}" for part in ("chunk_index", "file_index", *SPAN)]
        self._episodes = reader.episode_table(self.root, places).to_pylist()

    def is_depth(self, key: str) -> bool:
        """Whether a key's images are depth."""
        return reader.is_depth(self._images[key])

    def images(self, episode: int, key: str) -> Iterator[NDArray]:
        """All stored images of one episode and key, however many rows the episode has.

        Yields:
            RGB uint8 (height, width, 3), or depth uint16 (height, width) in millimetres.

        Raises:
            DatasetError: an image is missing, has another size than declared, or cannot be decoded.
        """
        return (self._from_video if key in self._videos else self._from_table)(episode, key)

    def _from_video(self, episode: int, key: str) -> Iterator[NDArray]:
        entry = self._episodes[episode]
        path = reader.stored_file(self.root, entry, f"videos/{key}")
        try:
            millimetres = self._depth_of_codes(key) if self.is_depth(key) else None
            pixel_format, kind = ("rgb24", np.uint8) if millimetres is None else ("gray12le", np.uint16)
            first, end = (round(entry[f"videos/{key}/{time}"] * self._fps) for time in SPAN)
            with av.open(str(path), format="mp4") as container:  # no playlist, which leads elsewhere
                if len(container.streams) != 1:  # readers choose differently among several
                    raise ValueError(f"it has {len(container.streams)} streams, but must have one")
                stream = container.streams.video[0]
                _check_size(f"{key} in {path}", (stream.height, stream.width), self.shapes[key])
                # A stream may go over to larger images after its header; decoders pad to whole blocks.
                limit = (stream.height + PADDING) * (stream.width + PADDING)
                stream.codec_context.options = {"max_pixels": str(limit)}
                assert stream.time_base is not None
                container.seek(int(first / self._fps / stream.time_base), stream=stream)
                for frame in container.decode(stream):
                    number = round((frame.time or 0.0) * self._fps)
                    if number >= end:
                        return
                    if number >= first:
                        _check_size(f"{key} in {path}", (frame.height, frame.width), self.shapes[key])
                        pixels = np.asarray(frame.to_ndarray(format=pixel_format), kind)
                        yield pixels if millimetres is None else millimetres[pixels]
        except (OSError, IndexError, TypeError, ValueError, OverflowError, av.error.FFmpegError) as error:
            raise DatasetError(f"cannot decode {path}: {error}") from error

    def _from_table(self, episode: int, key: str) -> Iterator[NDArray]:
        from datasets import Image as StoredImage

        stored = StoredImage()  # as LeRobot's loader reads them in training
        path = reader.stored_file(self.root, self._episodes[episode], "data")
        column = reader.read_table(path, columns=[key], filters=[("episode_index", "=", episode)])[key]
        for row, cell in enumerate(column):
            place = f"row {row} of {key} in {path}"
            try:
                content = cell.as_py()["bytes"]
                image = Image.open(io.BytesIO(content), formats=FORMATS)
                _check_size(place, image.size[::-1], self.shapes[key])
                pixels = np.asarray(stored.decode_example({"bytes": content, "path": None}))
            except DatasetError:
                raise
            except Exception as error:  # Pillow's readers of damaged bytes raise nearly anything
                raise DatasetError(f"cannot decode {place}: {error}") from error
            yield pixels

    def _depth_of_codes(self, key: str) -> NDArray[np.uint16]:
        """Depth in millimetres (4096,) of every code that a video stores."""
        from lerobot.datasets.depth_utils import dequantize_depth

        info = self._images[key]["info"]
        options = {name: info.get(f"video.{name}") for name in ("depth_min", "depth_max", "shift", "use_log")}
        codes = np.arange(2**12, dtype=np.uint16)[None]
        return np.asarray(dequantize_depth(codes, output_tensor=False, **options), np.uint16).ravel()


def _check_size(place: str, found: tuple[int, ...], shape: tuple[int, ...]) -> None:
    if found != shape[:2]:
        raise DatasetError(f"{place} has the shape {found}, not {shape[:2]}")
