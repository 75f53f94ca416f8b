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

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord, eval_key, result_versions
from lerobot_env_bimanual.episode_recorder import OUT_OF_TIME, PLAYED
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.options import EnvOptions

EPISODES_SUFFIX = "_episodes.json"
"""Of the log that lies beside films."""
MAX_REASONS = 5
"""In the last line, which has to stay readable."""
RECORDED_OPTIONS = (
    "variation",
    "split",
    "cameras",
    "image_size",
    "obs",
    "control_mode",
    "max_keyposes",
    "perturb",
)
"""That decide what is played and seen."""

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
        options: of the environments; they say where the films are, beside which the list of episodes is written, and
            where the record belongs.
        environments: number of them.
    """

    def __init__(self, task: str, options: EnvOptions, environments: int):
        self._task = task
        self._options = options
        self._environments = environments
        self._running: set[int] = set()
        self._finished: list[FinishedEpisode] = []
        self._played: list[Episode] = []

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
                if PLAYED in info:
                    self._played.append(info[PLAYED][index])
                logger.info("%s, %s", self._task, episode)

    def close(self) -> None:
        """Sum up the episodes since the last time, if there were any."""
        finished, self._finished = self._finished, []
        played, self._played = self._played, []
        self._running.clear()
        if not finished:
            return
        failures = Counter(episode.reason for episode in finished if not episode.success)
        reasons = ", ".join(f"{count} x {reason}" for reason, count in failures.most_common(MAX_REASONS))
        solved = sum(episode.success for episode in finished)
        films = "--env.video_dir=FOLDER films every episode whole"
        if (folder := self._options.video_dir) is not None:
            films = f"films and {self._write(Path(folder), finished).name} in {folder}"
        if (folder := self._options.results_dir) is not None and played:
            films = f"{self._write_record(Path(folder), played)}; {films}"
        logger.info(
            "%s: %d of %d episodes solved%s; %s",
            self._task,
            solved,
            len(finished),
            reasons and f" ({reasons})",
            films,
        )

    def _write(self, folder: Path, finished: list[FinishedEpisode]) -> Path:
        path = folder / f"{self._task}{EPISODES_SUFFIX}"
        lines = ",\n ".join(json.dumps(asdict(episode)) for episode in finished)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(f"[\n {lines}\n]\n")
        except OSError as error:
            logger.warning("%s cannot be written: %s", path, error)
        return path

    def _write_record(self, folder: Path, played: list[Episode]) -> str:
        """Write what `lerobot-bimanual results verify` reads, and say where, or why not."""
        path = folder / record_name(self._task, self._options)
        record = EvaluationRecord(
            schema_version=2,
            task=self._task,
            world=world_version(self._task, self._options.perturb),
            options=recorded_options(self._options),
            batch_size=self._environments,
            versions=result_versions(),
            episodes=tuple(
                sorted(
                    {episode.seed: episode for episode in played}.values(), key=lambda episode: episode.seed
                )
            ),
        )
        try:
            record.write(path)
        except BimanualError as error:
            logger.warning("%s", error)
            return f"no record: {error}"
        return f"record in {path}"


def record_name(task: str, options: EnvOptions) -> str:
    """What the record of an evaluation is called."""
    return f"{eval_key(task, options.variation, options.perturb)}_{options.split}_record.json"


def recorded_options(options: EnvOptions) -> dict[str, str | int]:
    """The options that decide what is played and seen, by name."""
    values = {name: getattr(options, name) for name in RECORDED_OPTIONS}
    return {name: value if isinstance(value, int) else str(value) for name, value in values.items()}
