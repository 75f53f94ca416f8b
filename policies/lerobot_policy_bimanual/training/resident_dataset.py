"""A dataset that is decoded once and then stays in memory."""

from typing import Any

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

    A row has colours as integers, which LeRobot's training loop turns into [0, 1] on the policy's device, and all
    else as the dataset gives it. Attributes that are not found here are the dataset's.

    Args:
        dataset: What is read, once; so nothing random may be done to its rows.

    Raises:
        DatasetError: It does not fit into memory.
    """

    def __init__(self, dataset: LeRobotDataset):
        self._dataset = dataset
        self._depth_keys = set(dataset.meta.depth_keys)
        self._colour_keys = set(dataset.meta.camera_keys) - self._depth_keys
        self._columns: dict[str, Tensor | list] = {}
        for index in tqdm(range(len(dataset)), desc="decoding the dataset", unit="row"):
            row = self._packed(dataset[index])  # pyright: ignore[reportArgumentType]
            if index == 0:
                self._columns = _room_for(len(dataset), row)
            for key, value in row.items():
                self._columns[key][index] = value

    def __len__(self) -> int:
        """Number of rows."""
        return len(self._dataset)

    def __getitem__(self, index: int) -> Row:
        """One row."""
        row = {key: column[index] for key, column in self._columns.items()}
        return row | {key: row[key].float() for key in self._depth_keys & row.keys()}

    def __getattr__(self, name: str) -> Any:
        """Whatever else the dataset has, such as `meta`."""
        if name == "_dataset":  # as long as __init__ has not set it
            raise AttributeError(name)
        return getattr(self._dataset, name)

    def _packed(self, row: Row) -> Row:
        packed = {}
        for key, value in row.items():
            if key in self._depth_keys:
                value = value.to(torch.uint16)  # whole millimetres
            elif key in self._colour_keys and value.is_floating_point():
                value = (value * 255).round().to(torch.uint8)
            packed[key] = value
        return packed


def _room_for(rows: int, row: Row) -> dict[str, Tensor | list]:
    """Empty columns for rows like this one."""
    tensors = {key: value for key, value in row.items() if isinstance(value, Tensor)}
    needed = rows * sum(value.nbytes for value in tensors.values())
    free = psutil.virtual_memory().available
    if needed > MAX_SHARE * free:
        raise DatasetError(
            f"{rows} rows of this dataset take {needed / 1e9:.1f} GB of memory, more than {MAX_SHARE:.0%} of the "
            f"{free / 1e9:.1f} GB that are free. Use `lerobot-train`, or fewer rows, or smaller images"
        )
    return {
        key: torch.empty((rows, *value.shape), dtype=value.dtype) if key in tensors else [None] * rows
        for key, value in row.items()
    }
