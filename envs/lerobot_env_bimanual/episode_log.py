"""What became of the episodes of a vector environment, said while it happens and in one line at the end.

LeRobot's evaluation keeps rewards and successes only; why an episode failed is known here.
"""

from __future__ import annotations

import json
import logging
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

OUT_OF_TIME = "out of time"
MOST_REASONS = 5
"""In the last line, which has to stay readable."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class FinishedEpisode:
    """How an episode ended.

    Attributes:
        seed: of its reset.
        success: whether it was solved.
        failure: why it was not; empty after a success.
        ticks: control ticks that it took.
    """

    seed: int
    success: bool
    failure: str
    ticks: int

    @property
    def reason(self) -> str:
        """The failure without its details, so that equal ones can be counted."""
        return ":".join(self.failure.split(":")[:2])

    def __str__(self) -> str:
        verdict = "solved" if self.success else f"not solved ({self.failure})"
        return f"seed {self.seed}: {verdict}, {self.ticks} ticks"


class EpisodeLog:
    """Episodes of one task, as they end.

    Args:
        task: its name.
        folder: where the films are; the list of episodes is written beside them.
    """

    def __init__(self, task: str, folder: str | None):
        self._task = task
        self._folder = None if folder is None else Path(folder)
        self._running: set[int] = set()
        self._finished: list[FinishedEpisode] = []

    def begin(self, environments: Iterable[int]) -> None:
        """Note which environments have just been reset."""
        self._running.update(environments)

    def note(self, is_over: NDArray, info: Mapping[str, Any]) -> None:
        """Take notice of a step.

        Args:
            is_over: (environments,) bool.
            info: as a vector environment merges it: key -> one value per environment.
        """
        for index in sorted(self._running):
            if is_over[index]:
                self._running.remove(index)
                success = bool(info["is_success"][index])
                failure = "" if success else str(info["failure"][index] or OUT_OF_TIME)
                episode = FinishedEpisode(
                    int(info["seed"][index]), success, failure, int(info["ticks"][index])
                )
                self._finished.append(episode)
                logger.info("%s, %s", self._task, episode)

    def close(self) -> None:
        """Sum up the episodes since the last time, if there were any."""
        finished, self._finished = self._finished, []
        self._running.clear()
        if not finished:
            return
        failures = Counter(episode.reason for episode in finished if not episode.success)
        reasons = ", ".join(f"{count} x {reason}" for reason, count in failures.most_common(MOST_REASONS))
        solved = sum(episode.success for episode in finished)
        films = "--env.video_dir=FOLDER films every episode whole"
        if self._folder is not None:
            films = f"films and {self._write(self._folder, finished).name} in {self._folder}"
        logger.info(
            "%s: %d of %d episodes solved%s; %s",
            self._task,
            solved,
            len(finished),
            reasons and f" ({reasons})",
            films,
        )

    def _write(self, folder: Path, finished: list[FinishedEpisode]) -> Path:
        path = folder / f"{self._task}_episodes.json"
        lines = ",\n ".join(json.dumps(asdict(episode)) for episode in finished)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(f"[\n {lines}\n]\n")
        except OSError as error:
            logger.warning("%s cannot be written: %s", path, error)
        return path
