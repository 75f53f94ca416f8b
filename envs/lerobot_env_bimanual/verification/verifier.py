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
from lerobot_bimanual.dataset.reader import (
    RecordedDataset,
    RecordedEpisode,
    episode_table,
    read_table,
)
from lerobot_bimanual.episode import Demonstration
from lerobot_env_bimanual.verification.columns import check_bookkeeping, check_key
from lerobot_env_bimanual.verification.fault import Fault, faults_of
from lerobot_env_bimanual.verification.images import COMPLETE, DEPTH_RANGE, inspected_images
from lerobot_env_bimanual.verification.metadata import READABLE
from lerobot_env_bimanual.verification.rendering import RenderedRows, draw_rows
from lerobot_env_bimanual.verification.simulation import Player, check_replay
from lerobot_env_bimanual.verification.statistics import check_episode_statistics

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
        faults: check -> what is wrong, empty for a check that passed.
    """

    index: int
    content_hash: str
    faults: Mapping[str, tuple[Fault, ...]]


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
        episodes: list[RecordedEpisode] = []

        def read() -> Iterator[Fault]:
            episodes.append(self._dataset.episode(index))
            yield from ()

        faults = {READABLE: faults_of(read)}
        if not episodes:
            return EpisodeReport(index, "", faults)
        (episode,) = episodes
        faults["episode key"] = faults_of(check_key, self._dataset, episode)
        faults["bookkeeping"] = faults_of(self._check_bookkeeping, episode)
        played = self._play(episode, faults)
        hashes: list[str] = []
        faults["images"] = faults_of(self._check_images, episode, played, faults, hashes)
        return EpisodeReport(index, "".join(hashes), faults)

    def _check_bookkeeping(self, episode: RecordedEpisode) -> Iterator[Fault]:
        entry = self._entries[episode.index]
        yield from check_bookkeeping(episode, entry, self._sentences, self._dataset.info["fps"])

    def _play(self, episode: RecordedEpisode, faults: dict[str, tuple[Fault, ...]]) -> Demonstration | None:
        """The episode, played again and compared, if it can be."""
        if not self._thoroughness.simulate:
            return None
        played: list[Demonstration] = []

        def play() -> Iterator[Fault]:
            height, width, _ = next(iter(self._reader.shapes.values()))
            played.append(self._player.play(self._dataset, episode.meta, (height, width)))
            yield from check_replay(self._dataset, episode, played[0])

        faults["replay"] = faults_of(play)
        return played[0] if played else None

    def _check_images(
        self,
        episode: RecordedEpisode,
        played: Demonstration | None,
        faults: dict[str, tuple[Fault, ...]],
        hashes: list[str],
    ) -> Iterator[Fault]:
        """Decode every image once for all checks, which add what they find to `faults`."""
        image_faults: dict[str, list[Fault]] = {COMPLETE: [], DEPTH_RANGE: []}
        digest = EpisodeHash(episode, self._reader.units)
        is_sampled = episode.index == self._thoroughness.sampled
        rows = draw_rows(episode, LOADED_ROWS, self._thoroughness.seed) if is_sampled else []
        loaded: dict[int, dict[str, NDArray]] = {row: {} for row in rows}
        rendered = self._render(episode, played)
        for key, row, image in inspected_images(self._reader, episode.index, len(episode), image_faults):
            digest.add_image(key, image)
            if rendered is not None:
                rendered.see(key, row, image)
            if row in loaded:
                loaded[row][key] = image
        faults |= {check: tuple(found) for check, found in image_faults.items()}
        if rendered is not None:
            faults |= rendered.faults()
        if not image_faults[COMPLETE]:
            hashes.append(digest.hexdigest())
            faults["statistics"] = faults_of(check_episode_statistics, self._root, episode)
            # Not before all images are known to be harmless: LeRobot decodes whatever a cell holds, and opens its path.
            if is_sampled:
                faults["LeRobot's loader"] = faults_of(self._check_loader, episode, loaded)
        yield from ()

    def _render(self, episode: RecordedEpisode, played: Demonstration | None) -> RenderedRows | None:
        """New images of some rows, if they can be had."""
        is_video, count = self._dataset.view == "frames", self._thoroughness.rendered_rows
        if played is None or count == 0:
            return None
        rows = draw_rows(episode, count, self._thoroughness.seed, in_pairs=is_video)
        return RenderedRows(episode, played, rows, is_video)

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


def _stored(image: Any) -> NDArray:
    """LeRobot's tensor, RGB (3, H, W) in 0..1 or depth (1, H, W) in mm, as it was stored."""
    array = np.asarray(image)
    if array.shape[0] == 1:
        return np.rint(array[0]).astype(np.uint16)
    return np.rint(array.transpose(1, 2, 0) * 255).astype(np.uint8)
