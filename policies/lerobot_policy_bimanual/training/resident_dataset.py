"""A dataset that is decoded once and then stays in memory, the main one or a GPU's."""

import copy
from pathlib import Path
from typing import Any

import cv2
import datasets
import numpy as np
import psutil
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from torch import Tensor
from torch.utils.data import Dataset
from tqdm import tqdm

from lerobot_bimanual.errors import DatasetError

MAX_SHARE = 0.7
"""Of the free memory, that may be taken."""

type Row = dict[str, Any]


class ResidentDataset(Dataset):
    """The rows of a `LeRobotDataset` in memory, colours in 8 and depth in 16 bits, as they were recorded.

    Training then moves no image: an item is a number and what is text, and `batch` looks up the rest on the device.
    Attributes that are not found here are the dataset's.

    Args:
        dataset: what is read, once; so nothing random may be done to its rows.
        device: where the rows are kept.
        row_key: key of an item's number, different for datasets of one training.

    Raises:
        DatasetError: it does not fit into memory, or an image cannot be decoded.
    """

    def __init__(self, dataset: LeRobotDataset, device: torch.device, row_key: str = "row"):
        self.row_key = row_key
        self._dataset = dataset
        self._depth_keys = set(dataset.meta.depth_keys)
        self._colour_keys = set(dataset.meta.camera_keys) - self._depth_keys
        self._texts: list[dict[str, Any]] = []
        self._columns: dict[str, Tensor] = {}
        encoded = _without_decoding(dataset, self._colour_keys | self._depth_keys)
        for index in tqdm(range(len(dataset)), desc="decoding the dataset", unit="row"):
            row: Any = encoded[index]  # pyright: ignore[reportArgumentType]
            tensors = {
                key: _decoded(value) if isinstance(value, dict) else self._packed(key, value)
                for key, value in row.items()
                if isinstance(value, Tensor | dict)
            }
            if index == 0:
                self._columns = _room_for(len(dataset), tensors, device)
            for key, value in tensors.items():
                self._columns[key][index] = value
            self._texts.append({key: value for key, value in row.items() if key not in tensors})

    def __len__(self) -> int:
        """Number of rows."""
        return len(self._dataset)

    def __getitem__(self, index: int) -> Row:
        """A row's number, under `row_key`, and its texts."""
        return {self.row_key: index} | self._texts[index]

    def __getattr__(self, name: str) -> Any:
        """Whatever else the dataset has, such as `meta`."""
        if name == "_dataset":  # as long as __init__ has not set it
            raise AttributeError(name)
        return getattr(self._dataset, name)

    def batch(self, items: Row) -> Row:
        """What LeRobot's training loop makes of these rows: float tensors of colours in [0, 1], and all else.

        Args:
            items: items, collated.
        """
        rows = items[self.row_key]
        texts = {key: value for key, value in items.items() if key != self.row_key}
        return {key: self._unpacked(key, column[rows]) for key, column in self._columns.items()} | texts

    def _packed(self, key: str, value: Tensor) -> Tensor:
        if key in self._depth_keys:
            # Whole millimetres, as signed numbers: PyTorch cannot look up unsigned ones on every device.
            return value.to(torch.uint16).view(torch.int16)
        if key in self._colour_keys and value.is_floating_point():
            return (value * 255).round().to(torch.uint8)
        return value

    def _unpacked(self, key: str, value: Tensor) -> Tensor:
        if key in self._depth_keys:
            return (value.to(torch.int32) & 0xFFFF).float()
        return value.float() / 255 if key in self._colour_keys else value


def _without_decoding(dataset: LeRobotDataset, images: set[str]) -> LeRobotDataset:
    """The same dataset, of which rows hold the bytes of images that lie in tables.

    LeRobot decodes an image by way of Pillow and floating point numbers, three times as long as it takes here. What it
    takes from videos, or together with other rows, or in another unit than it is stored, is left to it.
    """
    info = dataset.meta.features
    plain = [
        key
        for key in images
        if info[key]["dtype"] == "image"
        and key not in (dataset.reader.delta_indices or {})
        and info[key].get("info", {}).get("depth_unit", dataset.depth_output_unit)
        == dataset.depth_output_unit
    ]
    encoded = copy.copy(dataset)
    encoded.reader = copy.copy(dataset.reader)
    for key in plain:
        encoded.reader.hf_dataset = encoded.hf_dataset.cast_column(key, datasets.Image(decode=False))
    return encoded


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


def _room_for(rows: int, row: dict[str, Tensor], device: torch.device) -> dict[str, Tensor]:
    """Empty columns for rows like this one."""
    needed = rows * sum(value.nbytes for value in row.values())
    free = torch.cuda.mem_get_info(device)[0] if device.type == "cuda" else psutil.virtual_memory().available
    if needed > MAX_SHARE * free:
        raise DatasetError(
            f"{rows} rows of this dataset take {needed / 1e9:.1f} GB of memory, more than {MAX_SHARE:.0%} of the "
            f"{free / 1e9:.1f} GB that are free on {device}. Use `lerobot-train`, or fewer rows, or smaller images"
        )
    return {
        key: torch.empty((rows, *value.shape), dtype=value.dtype, device=device) for key, value in row.items()
    }
