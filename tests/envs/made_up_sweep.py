"""Outcomes, an evaluator and a policy's rollout without a world, for tests of reports and sweeps."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sample_results import outcome, proved

from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.expert_report import EXPERTS, EpisodeOutcome
from lerobot_env_bimanual.episode.progress import draw_episode
from lerobot_env_bimanual.sweep.evaluator import EpisodeSpec
from lerobot_env_bimanual.tasks.registry import get_task

TASK = "dual_push_buttons"


def world(task: str, perturb: str) -> str:
    return f"{task} {perturb}".encode().hex()[-12:]


class MadeUpEvaluator:
    """The expert fails seed 1 where all is heaviest, the open-loop baseline solves seed 0 only."""

    specs: list[EpisodeSpec]
    n_means = 0

    def __init__(self, *_: Any):
        pass

    def __enter__(self) -> "MadeUpEvaluator":
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def mean_keyposes(self, task: str, variation: str) -> tuple[tuple[float, ...], ...]:
        MadeUpEvaluator.n_means += 1
        return ((float(variation), *[0.0] * 17),)

    def map(self, function: Any, items: Any, *_: Any, **__: Any) -> Iterator[str]:
        return (world(*function.args, item) for item in items)

    def play(self, specs: list[EpisodeSpec], label: str) -> list[EpisodeOutcome]:
        MadeUpEvaluator.specs += specs
        return [self.outcome(spec) for spec in specs]

    def outcome(self, spec: EpisodeSpec) -> EpisodeOutcome:
        success = spec.seed == 0
        if spec.player in EXPERTS:
            success = not (spec.seed == 1 and spec.perturb == "mass:3")
        drawn = draw_episode(get_task(spec.task).spec, spec.split, spec.seed, None).variation
        return outcome(success, spec.seed, task=spec.task, variation=drawn.index)


class MadeUpRollout:
    """A policy that solves even seeds, and is interrupted after some conditions."""

    remaining = 1000

    def __init__(self, checkpoint: Any, config: Any, batch_size: int, seeds: range, policy_flags: Any):
        self.seeds = seeds

    def play(self, perturb: str, records: Path, note: Any = lambda _: None) -> EvaluationRecord:
        if MadeUpRollout.remaining == 0:
            raise KeyboardInterrupt
        MadeUpRollout.remaining -= 1
        note(len(self.seeds))
        spec, outcomes = get_task(TASK).spec, "".join("x."[seed % 2] for seed in self.seeds)
        variations = {seed: draw_episode(spec, "test", seed, None).variation.index for seed in self.seeds}
        return EvaluationRecord(
            schema_version=2,
            task=TASK,
            world=world(TASK, perturb),
            options={},
            batch_size=2,
            versions={},
            episodes=tuple(
                episode.model_copy(update={"variation": variations[episode.seed]})
                for episode in proved(outcomes, self.seeds.start)
            ),
        )
