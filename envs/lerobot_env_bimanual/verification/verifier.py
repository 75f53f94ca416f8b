"""Verification of a dataset: every check by name, and what it found.

Checks are small functions that yield faults. They come in four tables: about the dataset as a whole, about an
episode's columns, about its images, and about what the simulation says to both.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from lerobot_bimanual.dataset.content_hash import episode_hash
from lerobot_bimanual.dataset.decoding import ImageReader
from lerobot_bimanual.dataset.reader import RecordedDataset
from lerobot_bimanual.errors import DatasetError
from lerobot_env_bimanual.verification.columns import COLUMN_CHECKS
from lerobot_env_bimanual.verification.fault import Fault
from lerobot_env_bimanual.verification.images import ImageInspection
from lerobot_env_bimanual.verification.metadata import METADATA_CHECKS
from lerobot_env_bimanual.verification.simulation import SimulationChecks

READABLE = "readable"
"""Whether an episode's table can be read at all; nothing else is checked of one that cannot."""


@dataclass(frozen=True)
class EpisodeReport:
    """What the checks of one episode found.

    Attributes:
        index: of the episode.
        content_hash: of its columns and decoded images.
        faults: check -> what is wrong, empty for a check that passed.
    """

    index: int
    content_hash: str
    faults: Mapping[str, tuple[Fault, ...]]


class Verifier:
    """Checks the episodes of one view, one at a time.

    Args:
        root: folder of the view.
        rendered: episodes whose images are compared with new ones.
        simulate: whether to replay; wrong for a dataset of another simulation.
    """

    def __init__(self, root: Path, rendered: Collection[int], simulate: bool):
        self._dataset = RecordedDataset(root)
        self._reader = ImageReader(root)
        self._rendered = rendered
        self._simulation = SimulationChecks(self._dataset, self._reader) if simulate else None

    def verify(self, index: int) -> EpisodeReport:
        """All checks of one episode."""
        try:
            episode = self._dataset.episode(index)
        except (DatasetError, OSError) as error:
            return EpisodeReport(index, "", {READABLE: (Fault(str(error)),)})
        faults = {READABLE: ()}
        faults |= {name: tuple(check(self._dataset, episode)) for name, check in COLUMN_CHECKS.items()}
        inspection = ImageInspection(self._reader, index, len(episode))
        content_hash = episode_hash(episode, inspection.streams())
        faults |= inspection.faults()
        if self._simulation is not None:
            faults |= self._simulation.run(episode, index in self._rendered and not inspection.is_broken)
        return EpisodeReport(index, content_hash, faults)


def verify_metadata(root: Path) -> dict[str, tuple[Fault, ...]]:
    """Checks of a dataset as a whole: check -> what is wrong."""
    dataset = RecordedDataset(root)
    return {name: tuple(check(dataset)) for name, check in METADATA_CHECKS.items()}
