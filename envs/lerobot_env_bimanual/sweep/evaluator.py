"""The engine of all sweeps: a pool of processes that plays episodes and keeps each outcome as soon as it is there.

Workers import neither LeRobot nor torch and render nothing. An outcome depends on its spec alone, so any number of
workers gives the same list, and outcomes that a log already holds are not played again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import islice

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.expert_report import EpisodeOutcome
from lerobot_env_bimanual.experts.baselines import mean_of_episodes
from lerobot_env_bimanual.sweep.log import EpisodeLog
from lerobot_env_bimanual.sweep.spec import EpisodeSpec, Keyposes, play
from lerobot_env_bimanual.workers import WorkerPool

MEAN_EPISODES = 30
"""Training episodes whose mean keyposes the open-loop baseline plays."""
MAX_SHOWN = 3
"""Accidents that an error names."""


class Evaluator(WorkerPool):
    """A pool of worker processes that plays episodes; use it in a `with` statement.

    Args:
        workers: number of processes; 0 takes one per core.
        log: keeps outcomes.
    """

    def __init__(self, workers: int, log: EpisodeLog | None = None):
        super().__init__(workers)
        self._log = log
        self._mean_keyposes: dict[tuple[str, str], Keyposes] = {}

    def play(self, specs: Sequence[EpisodeSpec], label: str) -> list[EpisodeOutcome]:
        """Outcomes of episodes, in their order, with a progress bar called `label`.

        Raises:
            BimanualError: an accident, such as the death of its process, ended an episode. All others are played, and kept
                in the log, before it is raised.
        """
        known = {spec: outcome for spec in specs if self._log and (outcome := self._log.get(spec))}
        missing = [spec for spec in specs if spec not in known]
        accidents: dict[EpisodeSpec, str] = {}

        def note(spec: EpisodeSpec, outcome: EpisodeOutcome | str) -> None:
            if isinstance(outcome, str):
                accidents[spec] = outcome
                return
            known[spec] = outcome
            if self._log:
                self._log.add(spec, outcome)

        for _ in self.map(play, missing, label, "episode", len(known), failed=_reason, note=note):
            pass  # `note` keeps each outcome at once, also one behind an episode that takes long
        if accidents:
            raise BimanualError(_not_played(accidents))
        return [known[spec] for spec in specs]

    def mean_keyposes(self, task: str, variation: str) -> Keyposes:
        """Mean keyposes of the expert's training episodes of one variation, which are played once.

        Raises:
            BimanualError: the expert solved none of them.
        """
        if (task, variation) not in self._mean_keyposes:
            specs = [EpisodeSpec(task, variation, "train", seed, "expert") for seed in range(MEAN_EPISODES)]
            outcomes = self.play(specs, f"{task}: training episodes")
            episodes = [outcome.commands for outcome in outcomes if outcome.success]
            if not episodes:
                raise BimanualError(
                    f"the expert of {task!r} solved no training episode, so there is no mean to play"
                )
            self._mean_keyposes[task, variation] = tuple(map(tuple, mean_of_episodes(episodes).tolist()))
        return self._mean_keyposes[task, variation]


def _reason(_: EpisodeSpec, reason: str) -> str:
    return reason


def _not_played(accidents: Mapping[EpisodeSpec, str]) -> str:
    shown = islice(sorted(accidents.items(), key=lambda item: item[0].seed), MAX_SHOWN)
    what = "one episode was" if len(accidents) == 1 else f"{len(accidents)} episodes were"
    reasons = "; ".join(f"{spec}: {reason}" for spec, reason in shown)
    return f"{what} not played ({reasons}); the same command tries again"
