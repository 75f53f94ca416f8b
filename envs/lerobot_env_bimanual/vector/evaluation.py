"""Evaluations: which policy is evaluated on which seeds, and its finished episodes in the log and on disk.

LeRobot's evaluation keeps only rewards and successes; this module also keeps why episodes failed.
"""

import logging
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from tqdm import tqdm

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.evaluation import EvaluationHead, EvaluationRecord, eval_key, result_versions
from lerobot_bimanual.results.journal import Journal
from lerobot_bimanual.results.record import BadRecord, Record
from lerobot_env_bimanual.experts.runner import OUT_OF_TIME
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.vector.episode_recorder import PLAYED

RECORDED_OPTIONS = tuple(
    each.name
    for each in fields(EnvOptions)
    if each.name not in ("video_dir", "results_dir", "render_quality")
)
"""Options that decide what is played and seen."""
MAX_REASONS = 5
"""Reasons of failure in the last line, which has to stay readable."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Evaluation:
    """What a program evaluates, as far as it is known.

    Attributes:
        policy: as in `EvaluationHead`; empty if unknown.
        seeds: seeds of the requested episodes; None if unknown. Episodes of other seeds only fill up the last batch, and are
            not played.
        random_state: returns the state of all random number generators of the process, as a text.
        set_random_state: restores such a state.
        trained_worlds: task -> version of the world in which the policy learned it, where its config says so.
        shows_bar: whether a progress bar counts the requested episodes.
        is_kept: whether the folder of the record stays, so that the log names it.
    """

    policy: Mapping[str, str | int] = field(default_factory=dict)
    seeds: Sequence[int] | None = None
    random_state: Callable[[], str] = str
    set_random_state: Callable[[str], object] = str
    trained_worlds: Mapping[str, str] = field(default_factory=dict)
    shows_bar: bool = False
    is_kept: bool = True


class _Entry(Record):
    """A finished episode, and the state of the program's random numbers after it."""

    episode: Episode
    random_state: str = ""


class KeptEpisodes:
    """The episodes of an evaluation of one task in a folder.

    Each is appended to `<name>_record.partial.jsonl` as it ends, and on the disk before the next begins. `finish` writes
    them to `<name>_record.json` when all requested episodes are there.

    Attributes:
        known: the episodes by seed.

    Raises:
        BimanualError: the folder holds episodes of another evaluation of the task, or of one that is running.
    """

    def __init__(
        self, folder: Path, task: str, options: EnvOptions, environments: int, evaluation: Evaluation
    ):
        self._path = folder / record_name(task, options)
        self._partial = self._path.with_suffix(".partial.jsonl")
        self._task, self._options, self._environments = task, options, environments
        self._evaluation = evaluation
        self._head: EvaluationHead | None = None
        self._journal: Journal[_Entry] | None = None
        self._interrupted: list[_Entry] = []
        self.known: dict[int, Episode] = {}
        if self._path.exists() or self._partial.exists():
            self.open()

    def open(self) -> None:
        """Open the files and read the episodes that they already hold, unless they are open.

        Raises:
            BimanualError: they are of another evaluation, or of one that is running.
        """
        if self._journal is not None:
            return
        self.known, head = {}, self._head or self._make_head()
        there = [path for path in (self._path, self._partial) if path.exists()]
        if there and not head.policy and self._head is None:
            raise BimanualError(
                f"{there[0]} is there already, and its policy may be another one: choose another folder, or remove the file"
            )
        journal = Journal(self._partial, _Entry, exclusive=True)
        try:
            if self._path.exists() and head.policy:
                record = EvaluationRecord.read(self._path)
                self._refuse(self._path, head.difference(record))
                self.known = {episode.seed: episode for episode in record.episodes}
            self._interrupted = journal.entries()
            if journal.header and head.policy and self._interrupted:
                self._refuse(self._partial, head.difference(self._head_of_partial(journal.header)))
            else:
                self._interrupted = []
                journal.restart(head.model_dump_json())
        except BimanualError:  # a notebook would keep the error, and with it the open journal
            if journal.header:
                journal.close()
            else:
                journal.remove()
            raise
        self.known |= {entry.episode.seed: entry.episode for entry in self._interrupted}
        self._head, self._journal = head, journal

    def add(self, episode: Episode) -> None:
        """Keep an episode that has just ended."""
        assert self._journal is not None
        self._journal.add(_Entry(episode=episode, random_state=self._evaluation.random_state()))
        self.known[episode.seed] = episode

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, Episode]:
        """Environment -> its episode, for the episodes of a batch that have been played before.

        The first batch that is played after an interruption starts from the random state that it had before.
        """
        self.open()
        known = self.known if self._evaluation.policy else {}
        skipped_episodes = {index: known[seed] for index, seed in seeds.items() if seed in known}
        first = min((seed for seed in seeds.values() if seed is not None), default=0)
        if len(skipped_episodes) < len(seeds):
            states = [entry.random_state for entry in self._interrupted if entry.episode.seed < first]
            self._interrupted = []
            if states and states[-1]:
                self._evaluation.set_random_state(states[-1])
        return skipped_episodes

    def finish(self) -> str:
        """Write the record if it has every requested episode; returns where the episodes are, or "" if there are none."""
        if self._journal is None or self._head is None:
            return ""
        missing = [seed for seed in self._evaluation.seeds or () if seed not in self.known]
        if missing or not self.known:
            text = f"{len(self.known)} episodes are kept in {self._partial}, the same command plays the other {len(missing)}"
            self._journal.close()
        else:
            episodes = tuple(self.known[seed] for seed in sorted(self.known))
            EvaluationRecord(**dict(self._head), episodes=episodes).write(self._path)
            self._journal.remove()
            text = f"record in {self._path}"
        self._journal = None
        return text

    def _make_head(self) -> EvaluationHead:
        options = ((name, getattr(self._options, name)) for name in RECORDED_OPTIONS)
        world = world_version(self._task, self._options.perturb, self._options.setting)
        trained = self._evaluation.trained_worlds.get(self._task, world)
        if trained != world and not self._options.perturb:
            logger.warning(
                f"the policy learned {self._task} in world {trained}, and is evaluated in {world}: another setting, perturbation or "
                "version of the task, which alone may make it fail; train it on demonstrations of the world of the evaluation"
            )
        return EvaluationHead(
            schema_version=2,
            task=self._task,
            world=world,
            options={name: int(value) if isinstance(value, int) else str(value) for name, value in options},
            batch_size=self._environments,
            versions=result_versions(),
            policy=dict(self._evaluation.policy),
        )

    def _head_of_partial(self, header: str) -> EvaluationHead:
        try:
            return EvaluationHead.from_json(header)
        except BadRecord as error:
            raise BadRecord(
                f"{self._partial}: {error}; choose another results_dir, or remove the file"
            ) from None

    def _refuse(self, path: Path, difference: str | None) -> None:
        if difference is not None:
            raise BimanualError(
                f"{path} is of another evaluation: {difference}; choose another results_dir, or remove the file"
            )


def record_name(task: str, options: EnvOptions) -> str:
    """File name of the record of an evaluation."""
    key = eval_key(task, options.variation, options.perturb, options.setting)
    return f"{key}_{options.split}_record.json"


class EvaluationLog:
    """Episodes of one task, as they end: in the log, in a bar, and in a record in the folder `options.results_dir`.

    Raises:
        BimanualError: the folder of the record holds another evaluation.
    """

    def __init__(self, task: str, options: EnvOptions, environments: int, evaluation: Evaluation):
        self._task, self._options = task, options
        self._running: set[int] = set()
        self._episodes: list[Episode] = []
        self._known = 0  # episodes that were played earlier
        self._evaluation, self._bar = evaluation, tqdm(disable=True)
        self._kept: KeptEpisodes | None = None
        if (folder := options.results_dir) is not None:
            self._kept = KeptEpisodes(Path(folder), task, options, environments, evaluation)

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, Episode | None]:
        """Note which environments have just been reset, and their seeds.

        Returns:
            Environment -> its episode, if it has been played before, or None if it only fills up the batch. Neither is to be
            played.
        """
        wanted = self._evaluation.seeds
        requested = {index: seed for index, seed in seeds.items() if wanted is None or seed in wanted}
        skipped_episodes: dict[int, Episode | None] = dict.fromkeys(seeds.keys() - requested.keys())
        if self._kept is not None:
            skipped_episodes |= self._kept.begin(requested)
        self._running = (self._running - seeds.keys()) | (seeds.keys() - skipped_episodes.keys())
        if self._evaluation.shows_bar and self._bar.disable:
            shown = getattr(sys.stderr, "unfiltered", sys.stderr)
            total = len(self._evaluation.seeds or ())
            self._bar = tqdm(desc=self._task, total=total, unit="episode", file=shown, position=0)
        for episode in skipped_episodes.values():
            self._known += episode is not None
            self._count(episode)
        return skipped_episodes

    def note(self, is_over: NDArray, info: Mapping[str, Any]) -> None:
        """Log, and keep, the episodes that a step has ended, given (environments,) bool and the merged info of the step."""
        for index in sorted(self._running):
            if is_over[index]:
                self._running.remove(index)
                episode = info[PLAYED][index] if PLAYED in info else _episode(info, index)
                if self._kept is not None:
                    self._kept.add(episode)
                self._count(episode)
                verdict = "solved" if episode.success else f"not solved ({episode.failure})"
                logger.info("%s, seed %d: %s, %d ticks", self._task, episode.seed, verdict, episode.ticks)

    def _count(self, episode: Episode | None) -> None:
        """Count an episode, unless it only fills up the batch."""
        if episode is not None:
            self._episodes.append(episode)
            self._bar.set_postfix(solved=sum(each.success for each in self._episodes), refresh=False)
            self._bar.update()

    def close(self) -> None:
        """Sum up the episodes since the last time, if there were any."""
        self._bar.close()
        episodes, self._episodes = self._episodes, []
        known_episodes, self._known = self._known, 0
        self._running.clear()
        kept = "" if self._kept is None else self._kept.finish()
        if not episodes:
            return
        videos = "--env.video_dir=FOLDER writes a video of every episode that is played"
        if (folder := self._options.video_dir) is not None:
            videos = f"videos in {folder}"
            if known_episodes:
                videos += (
                    f", but none of {known_episodes} played earlier: another results_dir plays them again"
                )
        if kept and self._evaluation.is_kept:
            videos = f"{kept}; {videos}"
        known = [episode.survived for episode in episodes if episode.survived is not None]
        real = f"; real arms could have executed {sum(known)} of {len(known)}" if known else ""
        logger.info("%s: %s%s; %s", self._task, summary(episodes), real, videos)


def summary(episodes: Sequence[Episode]) -> str:
    """How many episodes are solved, and why the others are not, such as "1 of 3 episodes solved (2 x out of time)"."""
    # Without their details, so that equal ones can be counted.
    failures = Counter(":".join(str(each.failure).split(":")[:2]) for each in episodes if not each.success)
    reasons = ", ".join(f"{count} x {reason}" for reason, count in failures.most_common(MAX_REASONS))
    solved = sum(episode.success for episode in episodes)
    return f"{solved} of {len(episodes)} episodes solved{reasons and f' ({reasons})'}"


def _episode(info: Mapping[str, Any], index: int) -> Episode:
    """The episode that an environment without a recorder has ended."""
    success = bool(info["is_success"][index])
    failure = None if success else str(info["failure"][index] or OUT_OF_TIME)
    seed, ticks = (int(info[name][index]) for name in ("seed", "ticks"))
    return Episode(seed=seed, success=success, failure=failure, ticks=ticks)
