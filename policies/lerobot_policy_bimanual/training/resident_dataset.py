"""A dataset that is decoded once and then stays in memory, of the host or of a GPU."""

import copy
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

import cv2
import datasets
import numpy as np
import psutil
import torch
from lerobot.datasets.language import LANGUAGE_COLUMNS
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from torch import Tensor
from torch.utils.data import Dataset
from tqdm import tqdm

from lerobot_bimanual.errors import DatasetError

MAX_SHARE = 0.7
"""Share of the free memory that a dataset may take."""

MAX_DEPTH_MM = 2**16 - 1
"""Largest depth that 16 bits hold; larger depths are clipped."""

type Row = dict[str, Any]


class ResidentDataset(Dataset):
    """The rows of a `LeRobotDataset` in memory, colours in 8 and depth in 16 bits, as they were recorded.

    Training then moves no image: an item is a row number and texts, and `batch` looks up the other columns on the device,
    with the rows before and after that the dataset's `delta_timestamps` name. Attributes that are not found here are the
    dataset's.

    Args:
        dataset: the dataset, which is read once; so its rows must not be transformed at random.
        device: device that holds the rows.
        row_key: key of an item's number, different for datasets of one training.
        images: keys of the images that are decoded and kept; by default all. Batches hold no others.

    Raises:
        DatasetError: it does not fit into memory, or an image cannot be decoded.
    """

    def __init__(
        self,
        dataset: LeRobotDataset,
        device: torch.device,
        row_key: str = "row",
        images: Collection[str] | None = None,
    ):
        self.row_key = row_key
        self._dataset = dataset
        self._depth_keys = set(dataset.meta.depth_keys)
        self._colour_keys = set(dataset.meta.camera_keys) - self._depth_keys
        self._texts: list[dict[str, Any]] = []
        self._columns: dict[str, Tensor] = {}
        episode = dataset.hf_dataset.data.column("episode_index").to_numpy()
        starts = np.flatnonzero(np.diff(episode, prepend=-1))
        lengths = np.diff(starts, append=len(episode))
        bounds = (np.repeat(starts, lengths), np.repeat(starts + lengths - 1, lengths))
        self._first, self._last = (torch.from_numpy(bound).to(device) for bound in bounds)
        read = set(dataset.meta.camera_keys if images is None else images)
        rows = stored_rows(dataset, read, zip(starts.tolist(), lengths.tolist(), strict=True))
        progress = tqdm(rows, desc="decoding the dataset", unit="row", total=len(dataset))
        for index, row in enumerate(progress):
            tensors = {
                key: self._packed(key, value) for key, value in row.items() if isinstance(value, Tensor)
            }
            if index == 0:
                self._columns = _room_for(len(dataset), tensors, device)
            for key, value in tensors.items():
                self._columns[key][index] = value
            self._texts.append({key: value for key, value in row.items() if key not in tensors})
        asked_for = dataset.reader.delta_indices or {}
        self._offsets = {
            key: torch.tensor(offsets, device=device)
            for key, offsets in asked_for.items()
            if key in self._columns
        }

    def __len__(self) -> int:
        """Number of rows."""
        return len(self._dataset)

    def __getitem__(self, index: int) -> Row:
        """A row's number, under `row_key`, and its texts."""
        return {self.row_key: index} | self._texts[index]

    def __getattr__(self, name: str) -> Any:
        """Get an attribute of the dataset, such as `meta`."""
        if name == "_dataset":  # before __init__ has set it
            raise AttributeError(name)
        return getattr(self._dataset, name)

    def batch(self, items: Row) -> Row:
        """Make the batch that LeRobot's loader makes of these rows, with colours as floats in [0, 1].

        Columns with `delta_timestamps` are (batch, offsets, ...). Beyond the ends of an episode its first or last row is
        repeated, and `<column>_is_pad` (batch, offsets) is true. LeRobot's language columns are lists.

        Args:
            items: items, collated.
        """
        texts = {key: value for key, value in items.items() if key != self.row_key}
        rows = items[self.row_key]
        # LeRobot's collation drops the language columns, although its processors use them.
        language = {
            key: [self._texts[row][key] for row in rows.tolist()]
            for key in LANGUAGE_COLUMNS
            if key in self._texts[0]
        }
        return dict(self._looked_up(rows.to(self._first.device))) | texts | language

    def _looked_up(self, rows: Tensor) -> Iterator[tuple[str, Tensor]]:
        """Yield the columns of rows (batch,), and their padding masks."""
        first, last = self._first[rows, None], self._last[rows, None]
        for key, column in self._columns.items():
            if (offsets := self._offsets.get(key)) is None:
                yield key, self._unpacked(key, column[rows])
                continue
            wanted = rows[:, None] + offsets
            yield f"{key}_is_pad", (wanted < first) | (wanted > last)
            found = self._unpacked(key, column[wanted.clamp(first, last)])
            # LeRobot gives a single frame of a video without the axis of time.
            single = len(offsets) == 1 and key in self._dataset.meta.video_keys
            yield key, found[:, 0] if single else found

    def _packed(self, key: str, value: Tensor) -> Tensor:
        if key in self._depth_keys:
            # Whole millimetres, as signed numbers: PyTorch cannot look up unsigned ones on every device.
            if value.dtype == torch.int16:
                return value
            return value.float().round().clamp(0, MAX_DEPTH_MM).to(torch.uint16).view(torch.int16)
        if key in self._colour_keys and value.is_floating_point():
            return (value * 255).round().to(torch.uint8)
        return value

    def _unpacked(self, key: str, value: Tensor) -> Tensor:
        if key in self._depth_keys:
            return (value.to(torch.int32) & 0xFFFF).float()
        return value.float() / 255 if key in self._colour_keys else value


def _room_for(rows: int, row: dict[str, Tensor], device: torch.device) -> dict[str, Tensor]:
    """Allocate columns for rows like this one."""
    needed = rows * sum(value.nbytes for value in row.values())
    free = torch.cuda.mem_get_info(device)[0] if device.type == "cuda" else psutil.virtual_memory().available
    if needed > MAX_SHARE * free:
        raise DatasetError(
            f"{rows} rows of this dataset take {needed / 1e9:.1f} GB of memory, more than {MAX_SHARE:.0%} of the "
            f"{free / 1e9:.1f} GB that are free on {device}. Use `lerobot-train`, or fewer rows, or smaller images, or "
            "fewer of them, by naming the policy's inputs (--policy.input_features)"
        )
    return {
        key: torch.empty((rows, *value.shape), dtype=value.dtype, device=device) for key, value in row.items()
    }


def stored_rows(
    dataset: LeRobotDataset, images: set[str], episodes: Iterable[tuple[int, int]]
) -> Iterator[dict[str, Any]]:
    """Yield the rows of a `LeRobotDataset` in order, each without rows before and after it, each image decoded once.

    LeRobot seeks to the key frame before every row of a video. Here a video is decoded from the start of an episode to its
    end, by the same decoder, so that the frames are bit-identical.

    Args:
        dataset: the dataset.
        images: keys of the images that are read; the others are left out of the rows.
        episodes: first row and number of rows of each.

    Yields:
        Tensors, texts, and images as tensors (channels, height, width), by their key.

    Raises:
        DatasetError: an image cannot be decoded.
    """
    left_out = set(dataset.meta.camera_keys) - images
    video_keys = [key for key in dataset.meta.video_keys if key in images]
    tables, videos = _with_videos(dataset, ()), _with_videos(dataset, video_keys)
    _leave_encoded(tables, images.intersection(dataset.meta.image_keys))
    for start, length in episodes:
        frames = {}
        if video_keys:
            videos.reader.delta_indices = {key: list(range(length)) for key in video_keys}
            episode = videos.reader.get_item(start)
            # LeRobot leaves out the axis of time where there is one frame only.
            frames = {key: episode[key] if length > 1 else episode[key][None] for key in video_keys}
        for offset in range(length):
            row: Any = tables[start + offset]  # pyright: ignore[reportArgumentType]
            yield {
                key: _decoded(value) if isinstance(value, dict) else value
                for key, value in row.items()
                if key not in left_out
            } | {key: pictures[offset] for key, pictures in frames.items()}


def _with_videos(dataset: LeRobotDataset, keys: Collection[str]) -> LeRobotDataset:
    """Copy a dataset without its other videos and without `delta_timestamps`."""
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
    """Have rows hold the encoded bytes of images in tables, which OpenCV decodes three times as fast as LeRobot does.

    Depth that LeRobot converts to another unit is left to LeRobot.
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
