"""A dataset that is decoded once and then stays in memory, the main one or a GPU's."""

from collections.abc import Collection, Iterator
from typing import Any

import psutil
import torch
from lerobot.datasets.language import LANGUAGE_COLUMNS
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from torch import Tensor
from torch.utils.data import Dataset
from tqdm import tqdm

from lerobot_bimanual.errors import DatasetError
from lerobot_policy_bimanual.training.stored_rows import StoredRows

MAX_SHARE = 0.7
"""Of the free memory, that may be taken."""

MAX_DEPTH_MM = 2**16 - 1
"""What 16 bits hold; what is farther away is taken for as far."""

type Row = dict[str, Any]


class ResidentDataset(Dataset):
    """The rows of a `LeRobotDataset` in memory, colours in 8 and depth in 16 bits, as they were recorded.

    Training then moves no image: an item is a number and what is text, and `batch` looks up the rest on the device, with
    the rows before and after it that the dataset's `delta_timestamps` ask for. Every row is kept once, however many others
    are learnt together with it. Attributes that are not found here are the dataset's.

    Args:
        dataset: what is read, once; so nothing random may be done to its rows.
        device: where the rows are kept.
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
        rows = StoredRows(dataset, dataset.meta.camera_keys if images is None else images)
        self._first, self._last = (bound.to(device) for bound in rows.bounds)
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
        """Whatever else the dataset has, such as `meta`."""
        if name == "_dataset":  # as long as __init__ has not set it
            raise AttributeError(name)
        return getattr(self._dataset, name)

    def batch(self, items: Row) -> Row:
        """What LeRobot's training loop makes of these rows: float tensors of colours in [0, 1], and all else.

        Columns that the dataset has `delta_timestamps` for are (batch, offsets, ...); beyond the ends of an episode its
        first or last row stands in, which `<column>_is_pad`, (batch, offsets), says. LeRobot's language columns are lists.

        Args:
            items: items, collated.
        """
        texts = {key: value for key, value in items.items() if key != self.row_key}
        rows = items[self.row_key]
        # LeRobot drops them when it collates, although its processors know them.
        language = {
            key: [self._texts[row][key] for row in rows.tolist()]
            for key in LANGUAGE_COLUMNS
            if key in self._texts[0]
        }
        return dict(self._looked_up(rows.to(self._first.device))) | texts | language

    def _looked_up(self, rows: Tensor) -> Iterator[tuple[str, Tensor]]:
        """Columns of rows (batch,), and what is padding in them."""
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
    """Empty columns for rows like this one."""
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
