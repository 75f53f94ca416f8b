"""Logs the episodes of a vector environment as they end, sums them up, and writes the record of the evaluation.

LeRobot's evaluation keeps rewards and successes only; why an episode failed is known here.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationRecord, eval_key, result_versions
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.vector.episode_recorder import OUT_OF_TIME, PLAYED

MAX_REASONS = 5
"""Reasons of failure in the last line, which has to stay readable."""
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
"""Options that decide what is played and seen."""

logger = logging.getLogger(__name__)


class EvaluationLog:
    """Episodes of one task, as they end.

    Args:
        task: its name.
        options: of the environments; `results_dir` is the folder of the record.
        environments: number of them.
    """

    def __init__(self, task: str, options: EnvOptions, environments: int):
        self._task, self._options, self._environments = task, options, environments
        self._running: set[int] = set()
        self._episodes: list[Episode] = []

    def begin(self, environments: Iterable[int]) -> None:
        """Note which environments have just been reset."""
        self._running.update(environments)

    def note(self, is_over: NDArray, info: Mapping[str, Any]) -> None:
        """Log the episodes that a step has ended.

        Args:
            is_over: (environments,) bool.
            info: as a vector environment merges it: key -> one value per environment.
        """
        for index in sorted(self._running):
            if is_over[index]:
                self._running.remove(index)
                episode = info[PLAYED][index] if PLAYED in info else _episode(info, index)
                self._episodes.append(episode)
                verdict = "solved" if episode.success else f"not solved ({episode.failure})"
                logger.info("%s, seed %d: %s, %d ticks", self._task, episode.seed, verdict, episode.ticks)

    def close(self) -> None:
        """Sum up the episodes since the last time, if there were any."""
        episodes, self._episodes = self._episodes, []
        self._running.clear()
        if not episodes:
            return
        failures = Counter(_reason(episode) for episode in episodes if not episode.success)
        reasons = ", ".join(f"{count} x {reason}" for reason, count in failures.most_common(MAX_REASONS))
        solved = sum(episode.success for episode in episodes)
        videos = "--env.video_dir=FOLDER writes a video of every episode"
        if (folder := self._options.video_dir) is not None:
            videos = f"videos in {folder}"
        if (folder := self._options.results_dir) is not None and episodes[0].proof is not None:
            videos = f"{self._write_record(Path(folder), episodes)}; {videos}"
        text = "%s: %d of %d episodes solved%s; %s"
        logger.info(text, self._task, solved, len(episodes), reasons and f" ({reasons})", videos)

    def _write_record(self, folder: Path, episodes: list[Episode]) -> str:
        """Write what `lerobot-bimanual results verify` reads, and say where, or why not."""
        path = folder / record_name(self._task, self._options)
        by_seed = {episode.seed: episode for episode in episodes}
        options = ((name, getattr(self._options, name)) for name in RECORDED_OPTIONS)
        record = EvaluationRecord(
            schema_version=2,
            task=self._task,
            world=world_version(self._task, self._options.perturb),
            options={name: value if isinstance(value, int) else str(value) for name, value in options},
            batch_size=self._environments,
            versions=result_versions(),
            episodes=tuple(by_seed[seed] for seed in sorted(by_seed)),
        )
        try:
            record.write(path)
        except BimanualError as error:
            logger.warning("%s", error)
            return f"no record: {error}"
        return f"record in {path}"


def record_name(task: str, options: EnvOptions) -> str:
    """File name of the record of an evaluation."""
    return f"{eval_key(task, options.variation, options.perturb)}_{options.split}_record.json"


def _episode(info: Mapping[str, Any], index: int) -> Episode:
    """The episode that an environment without a recorder has ended."""
    success = bool(info["is_success"][index])
    failure = None if success else str(info["failure"][index] or OUT_OF_TIME)
    return Episode(
        seed=int(info["seed"][index]), success=success, failure=failure, ticks=int(info["ticks"][index])
    )


def _reason(episode: Episode) -> str:
    """A failure without its details, so that equal ones can be counted."""
    return ":".join((episode.failure or "").split(":")[:2])
