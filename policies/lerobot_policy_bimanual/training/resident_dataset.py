"""A dataset that is decoded once and then stays in memory, of the host or of a GPU."""

from collections.abc import Collection, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import datasets
import numpy as np
import torch
from lerobot.configs.video import DEPTH_METER_UNIT, DEPTH_MILLIMETER_UNIT, DepthEncoderConfig
from lerobot.datasets.depth_utils import MM_PER_METRE, dequantize_depth
from lerobot.datasets.feature_utils import get_delta_indices
from lerobot.datasets.language import LANGUAGE_COLUMNS
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.video_utils import decode_video_frames
from torch import Tensor
from torch.utils.data import Dataset
from tqdm import tqdm

from lerobot_bimanual.errors import DatasetError
from lerobot_bimanual.resources import usable_memory

MAX_SHARE = 0.7
"""Share of the free memory that a dataset may take."""

MAX_DEPTH_MM = 2**16 - 1
"""Largest depth that 16 bits hold; larger depths are clipped."""

ROW = "row"
"""Key of the number of a row."""

type Row = dict[str, Any]


class ResidentDataset(Dataset):
    """The rows of a `LeRobotDataset` in memory, colours in 8 and depth in 16 bits, as they were recorded.

    Training then moves no image: an item is a row number and texts, and `batch` looks up the other columns on the device,
    with the rows before and after that the dataset's `delta_timestamps` name.

    Args:
        dataset: the dataset, which is read once; so its rows must not be transformed at random, and depth is in millimetres.
        device: device that holds the rows.
        images: keys of the images that are decoded and kept; by default all. Batches hold no others.
        video_backend: LeRobot's name of the decoder of videos; by default its own choice.

    Raises:
        DatasetError: it does not fit into memory, or an image cannot be decoded.
    """

    def __init__(
        self,
        dataset: LeRobotDataset,
        device: torch.device,
        images: Collection[str] | None = None,
        video_backend: str | None = None,
    ):
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
        episodes = zip(starts.tolist(), lengths.tolist(), strict=True)
        rows = self._stored_rows(read, episodes, video_backend)
        progress = tqdm(rows, desc="decoding the dataset", unit="row", total=len(dataset))
        for index, row in enumerate(progress):
            columns = {key: value for key, value in row.items() if isinstance(value, Tensor)}
            tensors = {key: self._packed(key, value) for key, value in columns.items()}
            if index == 0:
                self._columns = _allocate_columns(len(dataset), tensors, device)
            for key, value in tensors.items():
                self._columns[key][index] = value
            self._texts.append({key: value for key, value in row.items() if key not in tensors})
        delta_indices = get_delta_indices(dataset.delta_timestamps or {}, dataset.fps)
        self._offsets = {
            key: torch.tensor(offsets, device=device)
            for key, offsets in delta_indices.items()
            if key in self._columns
        }

    def __len__(self) -> int:
        """Number of rows."""
        return len(self._dataset)

    def __getitem__(self, index: int) -> Row:
        """A row's number, under `ROW`, and its texts."""
        return {ROW: index} | self._texts[index]

    def batch(self, items: Row) -> Row:
        """Make the batch that LeRobot's loader makes of these rows, with colours as floats in [0, 1].

        Columns with `delta_timestamps` are (batch, offsets, ...). Beyond the ends of an episode its first or last row is
        repeated, and `<column>_is_pad` (batch, offsets) is true. LeRobot's language columns are lists.

        Args:
            items: items, collated.
        """
        texts = {key: value for key, value in items.items() if key != ROW}
        rows = items[ROW]
        # LeRobot 0.6.1's collation drops the language columns, although its processors use them.
        language = {
            key: [self._texts[row][key] for row in rows.tolist()]
            for key in LANGUAGE_COLUMNS
            if key in self._texts[0]
        }
        return dict(self._select_rows(rows.to(self._first.device))) | texts | language

    def _select_rows(self, rows: Tensor) -> Iterator[tuple[str, Tensor]]:
        """Yield the columns of rows (batch,), and their padding masks."""
        first, last = self._first[rows, None], self._last[rows, None]
        for key, column in self._columns.items():
            if (offsets := self._offsets.get(key)) is None:
                yield key, self._unpacked(key, column.index_select(0, rows))
                continue
            requested_rows = rows[:, None] + offsets
            yield f"{key}_is_pad", (requested_rows < first) | (requested_rows > last)
            found = self._unpacked(key, column[requested_rows.clamp(first, last)])
            # LeRobot gives a single frame of a video without the axis of time.
            single = len(offsets) == 1 and key in self._dataset.meta.video_keys
            yield key, found[:, 0] if single else found

    def _stored_rows(
        self, images: set[str], episodes: Iterable[tuple[int, int]], video_backend: str | None
    ) -> Iterator[Row]:
        """Yield the rows in order, with those of their images that are read, each decoded once; depth is in millimetres.

        LeRobot seeks to the key frame before every row of a video. Here a video is decoded from the start of an episode to
        its end, by the same decoder, so that the frames are bit-identical. An episode is its first row and number of rows.
        """
        dataset = self._dataset
        meta: Any = dataset.meta
        table = dataset.hf_dataset
        left_out = set(meta.camera_keys) - images
        video_keys = [key for key in meta.video_keys if key in images]
        # Depth in metres is stored as floating-point numbers, which are left to LeRobot.
        notes = {key: meta.features[key].get("info") or {} for key in {*meta.depth_keys} & {*meta.image_keys}}
        in_metres = {key for key, note in notes.items() if note.get("depth_unit") == DEPTH_METER_UNIT}
        # OpenCV decodes images in tables three times as fast as LeRobot does.
        for key in set(meta.image_keys) - in_metres:
            table = table.cast_column(key, datasets.Image(decode=False))
        times_s = dataset.hf_dataset.data.column("timestamp").to_numpy()
        for start, length in episodes:
            frames = {}
            for offset in range(length):
                row: Any = table[start + offset]
                if offset == 0 and video_keys:
                    times = times_s[start : start + length].tolist()
                    frames = _frames(dataset, int(row["episode_index"]), video_keys, times, video_backend)
                row["task"] = meta.tasks.iloc[int(row["task_index"])].name
                row |= {key: row[key] * MM_PER_METRE for key in in_metres}
                yield {
                    key: _decoded(value) if isinstance(value, dict) else value
                    for key, value in row.items()
                    if key not in left_out
                } | {key: pictures[offset] for key, pictures in frames.items()}

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


def _allocate_columns(rows: int, row: dict[str, Tensor], device: torch.device) -> dict[str, Tensor]:
    """Allocate columns for rows like this one."""
    needed = rows * sum(value.nbytes for value in row.values())
    free = torch.cuda.mem_get_info(device)[0] if device.type == "cuda" else usable_memory()
    if needed > MAX_SHARE * free:
        raise DatasetError(
            f"{rows} rows of this dataset take {needed / 1e9:.1f} GB of memory, more than {MAX_SHARE:.0%} of the "
            f"{free / 1e9:.1f} GB that are free on {device}. Use `lerobot-train`, or fewer rows, or smaller images, or "
            "fewer of them, by naming the policy's inputs (--policy.input_features)"
        )
    return {key: value.new_empty((rows, *value.shape), device=device) for key, value in row.items()}


def _frames(
    dataset: LeRobotDataset, episode: int, keys: Collection[str], times_s: list[float], backend: str | None
) -> dict[str, Tensor]:
    """The frames of an episode's videos by their key, (length, channels, height, width)."""
    meta: Any = dataset.meta

    def decode(key: str) -> Tensor:
        is_depth = key in meta.depth_keys
        start_s = meta.episodes[episode][f"videos/{key}/from_timestamp"]
        frames = decode_video_frames(
            dataset.root / meta.get_video_file_path(episode, key),
            [start_s + time_s for time_s in times_s],
            dataset.tolerance_s,
            backend,
            return_uint8=True,
            is_depth=is_depth,
        )
        if not is_depth:
            return frames
        coding = DepthEncoderConfig.from_video_info(meta.features[key].get("info"))
        millimetres: Any = dequantize_depth(
            frames,
            depth_min=coding.depth_min,
            depth_max=coding.depth_max,
            shift=coding.shift,
            use_log=coding.use_log,
            output_unit=DEPTH_MILLIMETER_UNIT,
        )
        return millimetres

    with ThreadPoolExecutor(len(keys)) as pool:
        return dict(zip(keys, pool.map(decode, keys), strict=True))


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
