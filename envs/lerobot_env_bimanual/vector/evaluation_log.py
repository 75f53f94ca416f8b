"""Logs the episodes of a vector environment as they end, sums them up, and writes the record of the evaluation.

LeRobot's evaluation keeps rewards and successes only; why an episode failed is known here.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.vector.episode_recorder import OUT_OF_TIME, PLAYED
from lerobot_env_bimanual.vector.evaluation import Evaluation, KeptEpisodes

MAX_REASONS = 5
"""Reasons of failure in the last line, which has to stay readable."""

logger = logging.getLogger(__name__)


class EvaluationLog:
    """Episodes of one task, as they end.

    Args:
        task: its name.
        options: of the environments; `results_dir` is the folder of the record.
        environments: number of them.
        evaluation: who is evaluated.

    Raises:
        BimanualError: the folder of the record holds another evaluation.
    """

    def __init__(self, task: str, options: EnvOptions, environments: int, evaluation: Evaluation):
        self._task, self._options = task, options
        self._running: set[int] = set()
        self._episodes: list[Episode] = []
        self._kept: KeptEpisodes | None = None
        if (folder := options.results_dir) is not None:
            self._kept = KeptEpisodes(Path(folder), task, options, environments, evaluation)

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, Episode | None]:
        """Note which environments have just been reset.

        Args:
            seeds: environment -> seed of the episode that begins.

        Returns:
            Environment -> its episode, if it has been played before, or None if it only fills up the batch. Neither is to be
            played.

        Raises:
            BimanualError: the folder of the record holds another evaluation.
        """
        settled = {} if self._kept is None else self._kept.begin(seeds)
        self._running = (self._running - seeds.keys()) | (seeds.keys() - settled.keys())
        self._episodes += [episode for episode in settled.values() if episode is not None]
        return settled

    def note(self, is_over: NDArray, info: Mapping[str, Any]) -> None:
        """Log, and keep, the episodes that a step has ended.

        Args:
            is_over: (environments,) bool.
            info: as a vector environment merges it: key -> one value per environment.

        Raises:
            UnwritableOutput: an episode cannot be kept.
        """
        for index in sorted(self._running):
            if is_over[index]:
                self._running.remove(index)
                episode = info[PLAYED][index] if PLAYED in info else _episode(info, index)
                self._episodes.append(episode)
                if self._kept is not None:
                    self._kept.add(episode)
                verdict = "solved" if episode.success else f"not solved ({episode.failure})"
                logger.info("%s, seed %d: %s, %d ticks", self._task, episode.seed, verdict, episode.ticks)

    def close(self) -> None:
        """Sum up the episodes since the last time, if there were any."""
        episodes, self._episodes = self._episodes, []
        self._running.clear()
        kept = "" if self._kept is None else self._kept.finish()
        if not episodes:
            return
        failures = Counter(_reason(episode) for episode in episodes if not episode.success)
        reasons = ", ".join(f"{count} x {reason}" for reason, count in failures.most_common(MAX_REASONS))
        solved = sum(episode.success for episode in episodes)
        videos = "--env.video_dir=FOLDER writes a video of every episode"
        if (folder := self._options.video_dir) is not None:
            videos = f"videos in {folder}"
        if kept:
            videos = f"{kept}; {videos}"
        known = [episode.survived for episode in episodes if episode.survived is not None]
        real = f"; real arms would have gone through {sum(known)} of {len(known)}" if known else ""
        text = "%s: %d of %d episodes solved%s%s; %s"
        logger.info(text, self._task, solved, len(episodes), reasons and f" ({reasons})", real, videos)


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
