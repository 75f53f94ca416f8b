"""Verification of a dataset's episodes: every check by name, and what it found."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.content_hash import EpisodeHash
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.provenance import other_lerobot
from lerobot_bimanual.dataset.reader import (
    RecordedDataset,
    RecordedEpisode,
    episode_table,
    read_table,
)
from lerobot_bimanual.dataset.schema import DEPTH_MAX_M, DEPTH_MIN_M, MM_PER_M
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.columns import Player, check_bookkeeping, check_key, check_replay
from lerobot_env_bimanual.verification.fault import Fault, Findings
from lerobot_env_bimanual.verification.metadata import READABLE
from lerobot_env_bimanual.verification.rendering import RenderedRows, draw_rows
from lerobot_env_bimanual.verification.statistics import check_episode_statistics

COMPLETE, DEPTH_RANGE = "images complete", "depth range"
MIN_MM, MAX_MM = round(DEPTH_MIN_M * MM_PER_M), round(DEPTH_MAX_M * MM_PER_M)
LOADED_ROWS = 2
"""Rows of the sampled episode that are read through LeRobot's loader."""


@dataclass(frozen=True)
class Thoroughness:
    """What is done beyond reading.

    Attributes:
        simulate: whether episodes are played again; wrong for a dataset of another simulation.
        rendered_rows: rows of every episode whose images are compared with new ones, `ALL_ROWS` for all of them.
        seed: of the draw of rows.
        sampled: the episode that is also read through LeRobot's loader; None if there is none.
        cache: folder for LeRobot's loader.
    """

    simulate: bool
    rendered_rows: int
    seed: int = 0
    sampled: int | None = None
    cache: Path | None = None


@dataclass(frozen=True)
class EpisodeReport:
    """What the checks of one episode found.

    Attributes:
        index: of the episode.
        content_hash: of its columns and decoded images, empty if they cannot be read.
        faults: what is wrong, by check.
    """

    index: int
    content_hash: str
    faults: Findings


class Verifier:
    """Checks the episodes of one view, one at a time. Whatever its files hold, it reports and never raises.

    Args:
        root: folder of the view.
        thoroughness: what is done beyond reading.
        player: plays episodes again, perhaps for another view, too.
    """

    def __init__(self, root: Path, thoroughness: Thoroughness, player: Player):
        self._root = root
        self._thoroughness = thoroughness
        self._player = player

    def verify(self, index: int) -> EpisodeReport:
        """All checks of one episode."""
        faults, episode, played, content_hash = Findings(), None, None, ""
        with faults.of(READABLE):
            episode = self._dataset.episode(index)
        if episode is None:
            return EpisodeReport(index, "", faults)
        with faults.of("episode key") as found:
            found += check_key(self._dataset, episode)
        with faults.of("bookkeeping") as found:
            entry, fps = self._entries[episode.index], self._dataset.info["fps"]
            found += check_bookkeeping(episode, entry, self._sentences, fps)
        if self._thoroughness.simulate:
            with faults.of("replay") as found:
                height, width, _ = next(iter(self._reader.shapes.values()))
                played = self._player.play(self._dataset, episode.meta, (height, width))
                found += check_replay(self._dataset, episode, played)
        with faults.of("images"):
            content_hash = self._check_images(episode, played, faults)
        return EpisodeReport(index, content_hash, faults)

    def _check_images(self, episode: RecordedEpisode, played: Demonstration | None, faults: Findings) -> str:
        """Decode every image once for all checks; the content hash of the episode, empty if it has not all images."""
        digest, how = EpisodeHash(episode, self._reader.units), self._thoroughness
        rows = draw_rows(episode, LOADED_ROWS, how.seed) if episode.index == how.sampled else []
        loaded: dict[int, dict[str, NDArray]] = {row: {} for row in rows}
        rendered = None
        if played is not None and how.rendered_rows:
            is_video = self._dataset.view == "frames"
            compared = draw_rows(episode, how.rendered_rows, how.seed)
            rendered = RenderedRows(episode, played, compared, is_video)
        for key, row, image in _inspected_images(self._reader, episode.index, len(episode), faults):
            digest.add_image(key, image)
            if rendered is not None:
                rendered.see(key, row, image)
            if row in loaded:
                loaded[row][key] = image
        if rendered is not None:
            faults |= rendered.faults()
        if faults[COMPLETE]:
            return ""
        with faults.of("statistics") as found:
            exactly = not other_lerobot(self._dataset.provenance)
            found += check_episode_statistics(self._root, episode, exactly)
        # Not before all images are known to be harmless: LeRobot decodes whatever a cell holds, and opens its path.
        if loaded:
            with faults.of("LeRobot's loader") as found:
                found += self._check_loader(episode, loaded)
        return digest.hexdigest()

    def _check_loader(
        self, episode: RecordedEpisode, images: Mapping[int, Mapping[str, NDArray]]
    ) -> Iterator[Fault]:
        """Some rows of an episode come from LeRobot's loader as they were decoded here."""
        import datasets.config
        from lerobot.datasets.lerobot_dataset import LeRobotDataset

        if self._thoroughness.cache is not None:
            datasets.config.HF_DATASETS_CACHE = self._thoroughness.cache
        loader = LeRobotDataset(
            "local/verified", root=self._root, episodes=[episode.index], video_backend="pyav"
        )
        for row, wanted in images.items():
            item: Any = loader[row]
            for key, column in (episode.columns | episode.bookkeeping).items():
                if not np.array_equal(np.squeeze(item[key]), np.squeeze(column[row])):
                    yield Fault(f"LeRobot gives {key} as {item[key]}", row)
            for key, image in wanted.items():
                if not np.array_equal(_stored(item[key]), image):
                    yield Fault(f"LeRobot gives another image of {key}", row)
            if item["task"] != episode.meta.instruction:
                yield Fault(f"LeRobot gives the sentence {item['task']!r}", row)

    @cached_property
    def _dataset(self) -> RecordedDataset:
        return RecordedDataset(self._root)

    @cached_property
    def _reader(self) -> ImageReader:
        return ImageReader(self._root)

    @cached_property
    def _entries(self) -> list[dict[str, Any]]:
        return episode_table(self._root, ["episode_index", "dataset_from_index"]).to_pylist()

    @cached_property
    def _sentences(self) -> list[Any]:
        return read_table(self._root / "meta/tasks.parquet", columns=["task"])["task"].to_pylist()


def _inspected_images(
    reader: ImageReader, episode: int, rows: int, faults: Findings
) -> Iterator[tuple[str, int, NDArray]]:
    """(key, row, image) of all images of an episode, key by key; an image that cannot be decoded ends its key.

    Args:
        reader: of the dataset.
        episode: index.
        rows: number of rows that the episode's table has.
        faults: gets the findings of the checks `COMPLETE` and `DEPTH_RANGE`.
    """
    incomplete, out_of_range = (faults.setdefault(check, []) for check in (COMPLETE, DEPTH_RANGE))
    for key, shape in reader.shapes.items():
        row, form = 0, (shape, np.dtype(np.uint16 if reader.is_depth(key) else np.uint8))
        try:
            for image in reader.images(episode, key):
                if row == rows or ((*image.shape, 1)[:3], image.dtype) != form:
                    text = f"{key} has more images than rows, or one that is not {form[1]} {shape}"
                    incomplete.append(Fault(text, row))
                    break
                if reader.is_depth(key) and (image.min() < MIN_MM or image.max() > MAX_MM):
                    text = f"{key} reaches from {image.min()} to {image.max()} mm, beyond {MIN_MM} to {MAX_MM} mm"
                    out_of_range.append(Fault(text, row))
                yield key, row, image
                row += 1
            else:
                if row < rows:
                    incomplete.append(Fault(f"{key} has {row} images, but the episode {rows} rows"))
        except DatasetError as error:
            incomplete.append(Fault(str(error), row))


def _stored(image: Any) -> NDArray:
    """LeRobot's tensor, RGB (3, H, W) in 0..1 or depth (1, H, W) in mm, as it was stored."""
    array = np.asarray(image)
    if array.shape[0] == 1:
        return np.rint(array[0]).astype(np.uint16)
    return np.rint(array.transpose(1, 2, 0) * 255).astype(np.uint8)
