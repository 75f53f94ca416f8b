"""Verification of a dataset: every check by name, and what it found."""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lerobot_bimanual.dataset.checksums import checksum_problems, plain_files
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import RecordedDataset, RecordedEpisode
from lerobot_bimanual.episode import Demonstration
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.columns import Player, check_replay
from lerobot_env_bimanual.verification.fault import READABLE, Fault, Findings
from lerobot_env_bimanual.verification.rendering import DEPTH, RGB, difference, draw_rows, new_images

COMPLETE = "images complete"


def check_files(root: Path) -> Findings:
    """What is wrong with the files of a view, by check.

    If there are links or pipes, only these are reported, as every other check would follow them.
    """
    if odd := plain_files(root)[1]:
        return Findings({READABLE: [Fault(text) for text in odd]})
    findings = Findings()
    with findings.of("checksums") as found:
        found += map(Fault, checksum_problems(root))
    return findings


class Verifier:
    """Checks the episodes of one view, one at a time. Whatever its files hold, it reports and never raises.

    Args:
        root: folder of the view.
        player: plays episodes again, perhaps for another view, too; None for a dataset of another simulation.
        rendered_rows: rows of every episode whose images are compared with new ones, `ALL_ROWS` for all of them.
        seed: of the draw of rows.
    """

    def __init__(self, root: Path, player: Player | None, rendered_rows: int, seed: int = 0):
        self._root, self._player = root, player
        self._rendered_rows, self._seed = rendered_rows, seed

    def verify(self, index: int) -> Findings:
        """All checks of one episode."""
        faults, episode, played = Findings(), None, None
        with faults.of(READABLE):
            episode = self._dataset.episode(index)
        if episode is None:
            return faults
        if self._player is not None:
            with faults.of("replay") as found:
                height, width, _ = next(iter(self._reader.shapes.values()))
                played = self._player.play(self._dataset, episode, (height, width))
                found += check_replay(self._dataset, episode, played)
        with faults.of("images"):
            self._check_images(episode, played, faults)
        return faults

    def _check_images(self, episode: RecordedEpisode, played: Demonstration | None, faults: Findings) -> None:
        """Decode every image once, and compare those of some rows with new ones."""
        new, found, incomplete = {}, dict[str, list[Fault]](), faults.setdefault(COMPLETE, [])
        if played is not None and self._rendered_rows:
            rows = draw_rows(episode, self._rendered_rows, self._seed)
            new, found = new_images(episode, played, rows), {RGB: [], DEPTH: []}
        is_video = self._dataset.view == "frames"
        for key, row, image in _inspected_images(self._reader, episode.index, len(episode), incomplete):
            if row in new and (text := difference(image, new[row][key], is_video)):
                found[DEPTH if image.dtype == np.uint16 else RGB].append(Fault(f"{key} {text}", row))
        faults |= {check: differing[:1] for check, differing in found.items()}

    @cached_property
    def _dataset(self) -> RecordedDataset:
        return RecordedDataset(self._root)

    @cached_property
    def _reader(self) -> ImageReader:
        return ImageReader(self._root)


def _inspected_images(
    reader: ImageReader, episode: int, rows: int, incomplete: list[Fault]
) -> Iterator[tuple[str, int, NDArray]]:
    """(key, row, image) of all images of an episode with `rows` rows, key by key.

    After an image that cannot be decoded, the rest of its key is skipped; faults are added to `incomplete`.
    """
    for key, shape in reader.shapes.items():
        row, form = 0, (shape, np.dtype(np.uint16 if reader.is_depth(key) else np.uint8))
        try:
            for image in reader.images(episode, key):
                if row == rows or ((*image.shape, 1)[:3], image.dtype) != form:
                    text = f"{key} has more images than rows, or one that is not {form[1]} {shape}"
                    incomplete.append(Fault(text, row))
                    break
                yield key, row, image
                row += 1
            else:
                if row < rows:
                    incomplete.append(Fault(f"{key} has {row} images, but the episode {rows} rows"))
        except DatasetError as error:
            incomplete.append(Fault(str(error), row))
