"""What a dataset of LeRobot has stored, each thing read and decoded once."""

import copy
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import cv2
import datasets
import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from torch import Tensor

from lerobot_bimanual.errors import DatasetError


class StoredRows:
    """The rows of a `LeRobotDataset`, one after the other, each as it is stored: without rows before and after it.

    LeRobot reads a row of a video from the key frame before it on. Here a video is decoded from the start of an episode to
    its end, by the same decoder, so that the frames are the same to the bit.

    Args:
        dataset: what is read.
        images: keys of the images that are read; the others are left out of the rows.
    """

    def __init__(self, dataset: LeRobotDataset, images: Collection[str]):
        self._images = set(images)
        self._all_images = set(dataset.meta.camera_keys)
        self._video_keys = [key for key in dataset.meta.video_keys if key in self._images]
        self._tables = _with_videos(dataset, ())
        self._videos = _with_videos(dataset, self._video_keys)
        _leave_encoded(self._tables, self._images.intersection(dataset.meta.image_keys))
        of_row = dataset.hf_dataset.data.column("episode_index").to_numpy()
        self._starts = np.flatnonzero(np.diff(of_row, prepend=-1))
        self._lengths = np.diff(self._starts, append=len(of_row))

    @property
    def bounds(self) -> tuple[Tensor, Tensor]:
        """Of every row the first and the last row of its episode, (rows,) int64 each."""
        first = torch.from_numpy(np.repeat(self._starts, self._lengths))
        last = torch.from_numpy(np.repeat(self._starts + self._lengths - 1, self._lengths))
        return first, last

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Every row: tensors, texts, and images as tensors, (channels, height, width).

        Raises:
            DatasetError: an image cannot be decoded.
        """
        for start, length in zip(self._starts.tolist(), self._lengths.tolist(), strict=True):
            frames = self._frames(start, length) if self._video_keys else {}
            for offset in range(length):
                row: Any = self._tables[start + offset]  # pyright: ignore[reportArgumentType]
                yield {
                    key: _decoded(value) if isinstance(value, dict) else value
                    for key, value in row.items()
                    if key not in self._all_images or key in self._images
                } | {key: images[offset] for key, images in frames.items()}

    def _frames(self, start: int, length: int) -> dict[str, Tensor]:
        """The frames of an episode by their key, (length, channels, height, width)."""
        self._videos.reader.delta_indices = {key: list(range(length)) for key in self._video_keys}
        episode = self._videos.reader.get_item(start)
        # LeRobot leaves out the axis of time where there is one frame only.
        return {key: episode[key] if length > 1 else episode[key][None] for key in self._video_keys}


def _with_videos(dataset: LeRobotDataset, keys: Collection[str]) -> LeRobotDataset:
    """The same dataset, as if only these of its videos existed, and every row stood alone."""
    part = copy.copy(dataset)
    part.reader = copy.copy(dataset.reader)
    part.reader.delta_indices = None
    meta = copy.copy(dataset.meta)
    meta.info = copy.copy(meta.info)
    left_out = set(meta.video_keys).difference(keys)
    meta.info.features = {key: value for key, value in meta.features.items() if key not in left_out}
    part.meta = part.reader._meta = meta
    return part


def _leave_encoded(dataset: LeRobotDataset, images: Collection[str]) -> None:
    """Have rows hold the bytes of images that lie in tables.

    LeRobot decodes an image by way of Pillow and floating point numbers, three times as long as it takes here. What it
    gives in another unit than it is stored in is left to it.
    """
    for key in images:
        unit = dataset.meta.features[key].get("info", {}).get("depth_unit", dataset.depth_output_unit)
        if unit == dataset.depth_output_unit:
            dataset.reader.hf_dataset = dataset.hf_dataset.cast_column(key, datasets.Image(decode=False))


def _decoded(image: dict[str, Any]) -> Tensor:
    """Colours (channels, height, width) uint8, or depth (1, height, width) as int16, of an encoded image."""
    content = image["bytes"] or Path(image["path"]).read_bytes()
    pixels = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise DatasetError(f"an image of {len(content)} bytes cannot be decoded")
    if pixels.ndim == 2:  # depth, or one colour
        return torch.from_numpy(pixels.view(np.int16) if pixels.dtype == np.uint16 else pixels)[None]
    to_rgb = cv2.COLOR_BGRA2RGBA if pixels.shape[2] == 4 else cv2.COLOR_BGR2RGB
    return torch.from_numpy(cv2.cvtColor(pixels, to_rgb)).permute(2, 0, 1)
