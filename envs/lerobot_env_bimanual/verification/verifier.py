"""Verification of a dataset: every check by name, and what it found.

Checks are small functions that yield faults. They come in tables: about the dataset as a whole, about an episode's
columns, about its images, and about what the simulation, LeRobot's statistics and LeRobot's loader say to both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.content_hash import EpisodeHash
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode, read_info
from lerobot_bimanual.dataset.seal import what_is_no_file
from lerobot_bimanual.episode import Episode
from lerobot_env_bimanual.verification.bookkeeping import Bookkeeping
from lerobot_env_bimanual.verification.columns import COLUMN_CHECKS
from lerobot_env_bimanual.verification.fault import Fault, faults_of
from lerobot_env_bimanual.verification.images import ImageInspection
from lerobot_env_bimanual.verification.loader import LeRobotLoader
from lerobot_env_bimanual.verification.metadata import METADATA_CHECKS
from lerobot_env_bimanual.verification.rendering import RenderedRows, draw_rows
from lerobot_env_bimanual.verification.simulation import REPLAY, Player, compare_columns
from lerobot_env_bimanual.verification.statistics import ImageStatistics, StatisticsTable

READABLE = "readable"
"""Whether an episode's table can be read at all; nothing else is checked of one that cannot."""

BOOKKEEPING, STATISTICS, LOADER, IMAGES = "bookkeeping", "statistics", "LeRobot's loader", "images"
LOADED_ROWS = 2
"""Rows that are read through LeRobot's loader, of an episode that is looked at closely."""

QUICK_STATISTICS = 2
"""Streams of images whose statistics are computed again of every other episode, drawn at random."""


@dataclass(frozen=True)
class Thoroughness:
    """What is done beyond reading.

    Attributes:
        simulate: whether episodes are played again; wrong for a dataset of another simulation.
        rendered_rows: rows of every episode whose images are compared with new ones, `ALL_ROWS` for all of them.
        seed: of the draw of rows.
        cache: folder for LeRobot's loader; none if the dataset's metadata are too damaged for it.
        closely: episodes that are also read through LeRobot's loader, and the statistics of all of whose images are
            computed again; None for every one.
    """

    simulate: bool
    rendered_rows: int
    seed: int = 0
    cache: Path | None = None
    closely: frozenset[int] | None = None

    def is_close(self, episode: int) -> bool:
        """Whether an episode is looked at closely."""
        return self.closely is None or episode in self.closely

    def streams(self, episode: int, keys: Sequence[str]) -> list[str]:
        """Keys of the images whose statistics are computed again."""
        if self.is_close(episode):
            return [*keys]
        rng = np.random.default_rng([self.seed, episode])
        return [keys[int(place)] for place in rng.permutation(len(keys))[:QUICK_STATISTICS]]


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
        player: who plays episodes again, perhaps for another view, too.
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
        for name, check in COLUMN_CHECKS.items():
            faults[name] = faults_of(check, self._dataset, episode)
        faults[BOOKKEEPING] = faults_of(self._check_bookkeeping, episode)
        played = self._play(episode, faults)
        hashes: list[str] = []
        faults[IMAGES] = faults_of(self._check_images, episode, played, faults, hashes)
        return EpisodeReport(index, "".join(hashes), faults)

    def _check_bookkeeping(self, episode: RecordedEpisode) -> Iterator[Fault]:
        yield from self._books.check_rows(episode)

    def _play(self, episode: RecordedEpisode, faults: dict[str, tuple[Fault, ...]]) -> Episode | None:
        """The episode, played again and compared, if it can be."""
        if not self._thoroughness.simulate:
            return None
        played: list[Episode] = []

        def play() -> Iterator[Fault]:
            height, width, _ = next(iter(self._reader.shapes.values()))
            played.append(self._player.play(self._dataset, episode.meta, (height, width)))
            faults.update(compare_columns(self._dataset, episode, played[0]))
            yield from faults.pop(REPLAY)

        faults[REPLAY] = faults_of(play)
        return played[0] if played else None

    def _check_images(
        self,
        episode: RecordedEpisode,
        played: Episode | None,
        faults: dict[str, tuple[Fault, ...]],
        hashes: list[str],
    ) -> Iterator[Fault]:
        """Decode every image once and show it to all who want to see it; they say what they found by themselves."""
        inspection = ImageInspection(self._reader, episode.index, len(episode))
        digest = EpisodeHash(episode, self._reader.units)
        features = read_info(self._root)["features"]
        keys = [*self._reader.shapes]
        statistics = {
            key: ImageStatistics(features[key], len(episode))
            for key in self._thoroughness.streams(episode.index, keys)
        }
        rendered = self._render(episode, played)
        loaded_rows = LOADED_ROWS if self._loads(episode.index) else 0
        loaded = {row: {} for row in draw_rows(episode, loaded_rows, self._thoroughness.seed)}
        for key, row, image in inspection.images():
            digest.add_image(key, image)
            if key in statistics:
                statistics[key].add(row, image)
            if rendered is not None:
                rendered.see(key, row, image)
            if row in loaded:
                loaded[row][key] = image
        faults |= inspection.faults()
        if rendered is not None:
            faults |= rendered.faults()
        whole = {key: statistics[key] for key in inspection.whole if key in statistics}
        unseen = [key for key in keys if key not in statistics]
        faults[STATISTICS] = faults_of(self._statistics.check, episode, whole, unseen)
        # Not before all images are known to be harmless: LeRobot decodes whatever a cell holds, and opens its path.
        if loaded and len(inspection.whole) == len(keys):
            faults[LOADER] = faults_of(self._check_loader, episode, loaded)
        if len(inspection.whole) == len(keys):
            hashes.append(digest.hexdigest())
        yield from ()

    def _render(self, episode: RecordedEpisode, played: Episode | None) -> RenderedRows | None:
        """New images of some rows, if they can be had."""
        is_video, count = self._dataset.view == "frames", self._thoroughness.rendered_rows
        if played is None or count == 0:
            return None
        rows = draw_rows(episode, count, self._thoroughness.seed, in_pairs=is_video)
        return RenderedRows(episode, played, rows, is_video)

    def _loads(self, episode: int) -> bool:
        return self._thoroughness.cache is not None and self._thoroughness.is_close(episode)

    def _check_loader(
        self, episode: RecordedEpisode, images: Mapping[int, Mapping[str, NDArray]]
    ) -> Iterator[Fault]:
        yield from self._loader.check(episode, images)

    @cached_property
    def _dataset(self) -> RecordedDataset:
        return RecordedDataset(self._root)

    @cached_property
    def _reader(self) -> ImageReader:
        return ImageReader(self._root)

    @cached_property
    def _books(self) -> Bookkeeping:
        return Bookkeeping(self._root)

    @cached_property
    def _statistics(self) -> StatisticsTable:
        return StatisticsTable(self._root)

    @cached_property
    def _loader(self) -> LeRobotLoader:
        assert self._thoroughness.cache is not None
        return LeRobotLoader(self._root, self._thoroughness.cache)


def verify_metadata(root: Path) -> dict[str, tuple[Fault, ...]]:
    """Checks of a dataset as a whole: check -> what is wrong.

    Where it holds links or pipes that is all that is said, as every other check would follow them.
    """
    if odd := what_is_no_file(root):
        return {READABLE: tuple(Fault(text) for text in odd)}
    return {name: faults_of(check, root) for name, check in METADATA_CHECKS.items()}
