"""A campaign and a policy's rollout without a world, for tests of ladders."""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lerobot_bimanual.results.episode import Episode, Proof
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.checkpoint import Checkpoint
from lerobot_env_bimanual.episode.progress import draw_episode
from lerobot_env_bimanual.experts.outcome import Job, MoveReport, Outcome
from lerobot_env_bimanual.tasks.registry import get_task

TASK = "dual_push_buttons"
HOLD = tuple([0.0] * 18)


def world_of(perturb: str) -> str:
    """A made-up version of the world of a condition."""
    return hashlib.sha256(perturb.encode()).hexdigest()[:12]


class MadeUpCampaign:
    """Outcomes without a world: the expert fails seed 1 where all is heaviest, the blind control solves seed 0."""

    jobs: list[Job]

    def __init__(self, *_: Any):
        pass

    def __enter__(self) -> "MadeUpCampaign":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def blind_keyposes(self, task: str, variation: str) -> tuple[tuple[float, ...], ...]:
        return ((float(variation), *HOLD[1:]),)

    def map(self, function: Any, items: Any, *_: Any) -> Iterator[str]:
        return (world_of(perturb) for _, perturb in items)

    def play(self, jobs: list[Job], label: str) -> list[Outcome]:
        MadeUpCampaign.jobs += jobs
        return [self.outcome(job) for job in jobs]

    def outcome(self, job: Job) -> Outcome:
        if job.control in ("expert", "rereading"):
            success = not (job.seed == 1 and job.perturb == "mass:3")
        else:
            success = job.seed == 0
        spec = get_task(job.task).spec
        variation = draw_episode(spec, job.split, job.seed, spec.variation_index(job.variation)).variation
        return Outcome(
            job.task,
            variation.index,
            job.split,
            job.seed,
            success,
            "" if success else "out of time",
            "move",
            (),
            (MoveReport("move", HOLD, 1, (0.0, 0.0), True),),
            1,
            1,
            0,
            False,
            "00",
        )


class MadeUpRollout:
    """A policy that solves even seeds, and whose owner may lose patience."""

    patience = 1000

    def __init__(
        self,
        checkpoint: Checkpoint,
        config: Any,
        batch_size: int,
        seeds: range,
        policy_flags: tuple[str, ...],
    ):
        self.config, self.seeds = config, seeds

    def play(self, perturb: str, records: Path, note: Any = lambda _: None) -> EvaluationRecord:
        if MadeUpRollout.patience == 0:
            raise KeyboardInterrupt
        MadeUpRollout.patience -= 1
        note(len(self.seeds))
        spec = get_task(TASK).spec
        episodes = []
        for seed in self.seeds:
            variation = draw_episode(spec, "test", seed, None).variation.index
            solved = seed % 2 == 0
            failure = None if solved else "out of time"
            episodes.append(
                Episode(
                    seed=seed,
                    variation=variation,
                    success=solved,
                    failure=failure,
                    ticks=9,
                    keyposes=2,
                    proof=Proof(instruction="push", start="0a" * 32, actions=(), links="", end="0b" * 32),
                )
            )
        return EvaluationRecord(
            schema_version=2,
            task=TASK,
            world=world_of(perturb),
            options={},
            batch_size=2,
            versions={},
            episodes=tuple(episodes),
        )
