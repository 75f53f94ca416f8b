"""Many episodes on one machine: a process pool that plays jobs and gives their outcomes in order.

Workers import neither LeRobot nor torch and render nothing. An outcome depends on its job alone, so any number of
workers gives the same list, and outcomes that a log already knows need not be played again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from itertools import islice

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import BimanualError, PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.control_names import EXPERTS
from lerobot_env_bimanual.experts.controls import make_control, mean_keyposes
from lerobot_env_bimanual.experts.evidence import EvidenceRecorder
from lerobot_env_bimanual.experts.outcome import Job, Keyposes, Outcome
from lerobot_env_bimanual.experts.outcome_log import OutcomeLog
from lerobot_env_bimanual.experts.runner import Move, failed_to_start, run_episode
from lerobot_env_bimanual.workers import WorkerPool

BLIND_EPISODES = 30
"""Training episodes whose mean keyposes the blind control plays."""
MOST_ACCIDENTS = 3
"""As many are told of one campaign."""


class Campaign(WorkerPool):
    """A pool of worker processes that play jobs; use it in a `with` statement.

    Args:
        workers: number of processes; 0 takes one per core.
        log: knows the outcomes of jobs that were played before, and learns the others.
    """

    def __init__(self, workers: int, log: OutcomeLog | None = None):
        super().__init__(workers)
        self._log = log
        self._blind_keyposes: dict[tuple[str, str], Keyposes] = {}

    def play(self, jobs: Sequence[Job], label: str) -> list[Outcome]:
        """Outcomes of the jobs, in their order, with a progress bar called `label`.

        Raises:
            BimanualError: an episode ended by an accident, such as the death of its process, which is nobody's failure. All
                others are played, and noted in the log, before it is raised.
        """
        known = {job: outcome for job in jobs if self._log and (outcome := self._log.get(job))}
        todo = [job for job in jobs if job not in known]
        accidents: dict[Job, str] = {}

        def note(job: Job, outcome: Outcome | str) -> None:
            if isinstance(outcome, str):
                accidents[job] = outcome
                return
            known[job] = outcome
            if self._log:
                self._log.add(job, outcome)

        for _ in self.map(play, todo, label, "episode", len(known), failed=_reason, note=note):
            pass  # noted as they come, so that none is lost behind one that takes long
        if accidents:
            raise BimanualError(_not_played(accidents))
        return [known[job] for job in jobs]

    def blind_keyposes(self, task: str, variation: str) -> Keyposes:
        """Mean keyposes of the expert's training episodes of one variation, which are played once.

        Raises:
            BimanualError: the expert solved none of them.
        """
        if (task, variation) not in self._blind_keyposes:
            self._blind_keyposes[task, variation] = self._mean_keyposes(task, variation)
        return self._blind_keyposes[task, variation]

    def _mean_keyposes(self, task: str, variation: str) -> Keyposes:
        jobs = [Job(task, variation, "train", seed, "expert") for seed in range(BLIND_EPISODES)]
        outcomes = self.play(jobs, f"{task}: training episodes")
        episodes = [[move.keypose for move in outcome.keyposes] for outcome in outcomes if outcome.success]
        if not episodes:
            raise BimanualError(
                f"the expert of {task!r} solved no training episode, so there is no mean to play"
            )
        return tuple(map(tuple, mean_keyposes(episodes).tolist()))


def _reason(_: Job, reason: str) -> str:
    return reason


def _not_played(accidents: Mapping[Job, str]) -> str:
    told = (
        f"{job.control} on seed {job.seed} of {job.task}{f' at {job.perturb}' if job.perturb else ''}: {reason}"
        for job, reason in islice(sorted(accidents.items(), key=lambda item: item[0].seed), MOST_ACCIDENTS)
    )
    what = "one episode was" if len(accidents) == 1 else f"{len(accidents)} episodes were"
    return f"{what} not played ({'; '.join(told)}); the same command tries again"


_environments: dict[tuple[str, str, str, str], BimanualEnv] = {}


def play(job: Job) -> Outcome:
    """Play one job in this process, in an environment that is kept for the next one of its kind."""
    key = (job.task, job.variation, job.split, job.perturb)
    if key not in _environments:
        for env in _environments.values():
            env.close()
        _environments.clear()
        _environments[key] = BimanualEnv(
            job.task, variation=job.variation, split=job.split, obs="state", perturb=job.perturb
        )
    env = _environments[key]
    codec = KeyposeCodec(voxels=job.discretise) if job.discretise else None
    control = make_control(job.control, job.seed, codec, job.blind_keyposes)
    moves: list[Move] = []
    recorder = EvidenceRecorder(env) if job.control in EXPERTS else None
    with nullcontext() if recorder is None else env.observed_by(recorder.note, recorder.note_step):
        try:
            outcome = run_episode(env, job.seed, control, moves.append)
        except PlacementFailure as failure:
            return failed_to_start(env, str(failure))
        except Exception:
            del _environments[key]  # in whatever state it is
            raise
    if recorder is None or not outcome.success:
        return outcome
    keyposes, ticks = [move.action for move in moves], [report.ticks for report in outcome.keyposes]
    return replace(outcome, evidence=recorder.evidence(keyposes, ticks, job.replay))
