"""Many episodes on one machine: a process pool that plays jobs and gives their outcomes in order.

Workers import neither LeRobot nor torch and render nothing. An outcome depends on its job alone, so any number of
workers gives the same list.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

from tqdm import tqdm

from lerobot_bimanual.codec import KeyposeCodec
from lerobot_bimanual.errors import BimanualError, PlacementFailure
from lerobot_bimanual.statistics import SuccessRate
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert.controls import make_control, mean_keyposes
from lerobot_env_bimanual.expert.runner import Outcome, run_episode
from lerobot_env_bimanual.processes import prepare_worker, use_one_thread_per_process

BLIND_EPISODES = 30
"""Training episodes whose mean keyposes the blind control plays."""

type Keyposes = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Job:
    """One episode to be played by some process.

    Attributes:
        task: name of the task.
        variation: index, or "any".
        split: split of the seed.
        seed: seed of the reset.
        control: one of `lerobot_env_bimanual.expert.controls.CONTROLS`.
        discretise: voxels per axis to which the expert's keyposes are rounded; 0 leaves them exact.
        blind_keyposes: (18,) each, what the control `blind` plays.
    """

    task: str
    variation: str
    split: str
    seed: int
    control: str
    discretise: int = 0
    blind_keyposes: Keyposes = ()


class Campaign:
    """A pool of worker processes; use it in a `with` statement.

    Args:
        workers: number of processes; 0 takes one per core.
    """

    def __init__(self, workers: int):
        count = workers or os.cpu_count() or 1
        use_one_thread_per_process()
        self._pool = ProcessPoolExecutor(count, get_context("forkserver"), initializer=prepare_worker)

    def __enter__(self) -> Campaign:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def play(self, jobs: Sequence[Job], label: str) -> list[Outcome]:
        """Outcomes of the jobs, in their order, with a progress bar called `label`."""
        played = self._pool.map(play, jobs)
        return list(tqdm(played, total=len(jobs), desc=label, unit="episode", smoothing=0))

    def blind_keyposes(self, task: str, variation: str) -> Keyposes:
        """Mean keyposes of the expert's training episodes of one variation.

        Raises:
            BimanualError: the expert solved none of them.
        """
        jobs = [Job(task, variation, "train", seed, "expert") for seed in range(BLIND_EPISODES)]
        outcomes = self.play(jobs, f"{task}: training episodes")
        episodes = [[move.keypose for move in outcome.keyposes] for outcome in outcomes if outcome.success]
        if not episodes:
            raise BimanualError(
                f"the expert of {task!r} solved no training episode, so there is no mean to play"
            )
        return tuple(map(tuple, mean_keyposes(episodes).tolist()))


def rates(outcomes: Sequence[Outcome]) -> dict[tuple[str, int], SuccessRate]:
    """Success rate per task and variation, sorted."""
    successes: dict[tuple[str, int], list[bool]] = defaultdict(list)
    for outcome in outcomes:
        successes[outcome.task, outcome.variation].append(outcome.success)
    return {key: SuccessRate(sum(successes[key]), len(successes[key])) for key in sorted(successes)}


_environments: dict[tuple[str, str, str], BimanualEnv] = {}


def play(job: Job) -> Outcome:
    """Play one job in this process, in an environment that is kept for the next one of its kind.

    Raises:
        PlacementFailure: the seed's episode cannot be set up.
    """
    key = (job.task, job.variation, job.split)
    if key not in _environments:
        _environments.clear()
        _environments[key] = BimanualEnv(job.task, job.variation, job.split, obs="state")
    codec = KeyposeCodec(voxels=job.discretise) if job.discretise else None
    control = make_control(job.control, job.seed, codec, job.blind_keyposes)
    try:
        return run_episode(_environments[key], job.seed, control)
    except PlacementFailure as failure:
        raise PlacementFailure(f"{job.split} seed {job.seed}: {failure}") from failure
