"""Sweep of a policy: the policy, the expert and the open-loop baseline play the same episodes in every condition of a task."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path

from tqdm import tqdm

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.files import locked
from lerobot_bimanual.results.evaluation import result_versions
from lerobot_bimanual.results.robustness import (
    ConditionKey,
    ExpertRobustnessReport,
    PolicyCondition,
    RobustnessConfig,
    RobustnessResult,
    condition_name,
    perturb_text,
)
from lerobot_env_bimanual.configuration_bimanual import BimanualEnvConfig
from lerobot_env_bimanual.sweep.checkpoint import Checkpoint
from lerobot_env_bimanual.sweep.conditions import (
    Conditions,
    check_same,
    merge_conditions,
    read_earlier,
    solved_seeds,
)
from lerobot_env_bimanual.sweep.evaluator import EpisodeLog, EpisodeSpec, Evaluator
from lerobot_env_bimanual.sweep.policy_rollout import PolicyRollout
from lerobot_env_bimanual.vector.evaluation import RECORDED_OPTIONS


@dataclass(frozen=True)
class PolicySweep:
    """A sweep over conditions, each kept as soon as it is played; the fields that `PolicyRollout` takes, too, are explained there.

    Attributes:
        conditions: of the environment's task.
        workers: processes for the expert and the open-loop baseline; 0 takes one per core.
        output: the result, a JSON file.
        expert_report: of the expert on the task under perturbations, if there is one.
    """

    checkpoint: Checkpoint
    env_config: BimanualEnvConfig
    conditions: Conditions
    seeds: range
    batch_size: int
    policy_flags: tuple[str, ...]
    workers: int
    output: Path
    expert_report: ExpertRobustnessReport | None

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.conditions.task

    @property
    def records(self) -> Path:
        """Folder of the environment's records, one file per condition, with every action of the policy."""
        return self.output.with_name(f"{self.output.stem}_records")

    @cached_property
    def config(self) -> RobustnessConfig:
        """What is measured."""
        env = self.env_config
        options = {name: str(getattr(env, name)) for name in RECORDED_OPTIONS if name != "perturb"}
        return RobustnessConfig(
            task=self.task,
            policy=self.checkpoint.policy,
            checkpoint_sha256=self.checkpoint.sha256,
            options=options,
            first_seed=self.seeds.start,
            episodes=len(self.seeds),
            batch_size=self.batch_size,
            policy_flags=self.policy_flags,
            versions=result_versions(),
        )

    def played(self) -> RobustnessResult | None:
        """The result of earlier runs; None if there was none.

        Raises:
            BimanualError: the file is damaged, or of another measurement.
        """
        return read_earlier(RobustnessResult, self.output, self.config, self.conditions)

    def missing(self) -> list[ConditionKey]:
        """Conditions that are not played yet."""
        result = self.played()
        return [key for key in self.conditions if result is None or key not in result.by_key]

    def run(self) -> Iterator[PolicyCondition]:
        """Update validity from the expert's report, play missing conditions, and yield each after it is written.

        Raises:
            BimanualError: as in `played`; or a condition or its expert report is of another world, or cannot be played; or
                another process plays this sweep.
        """
        self._check_worlds()
        with locked(self.records):
            yield from self._run()

    def _run(self) -> Iterator[PolicyCondition]:
        result, missing = self.played(), self.missing()
        if result is not None:
            result = self._write(result, map(self._with_expert_report, result.conditions))
        if not missing:
            return
        # It fails, if at all, before anything is played.
        rollout = PolicyRollout(
            self.checkpoint, self.env_config, self.batch_size, self.seeds, self.policy_flags
        )
        template = EpisodeSpec(self.task, str(self.env_config.variation), self.env_config.split, 0, "expert")
        keys = dict.fromkeys(map(self.conditions.reference_condition, missing))
        # For all policies of the task with results in the same folder.
        log = EpisodeLog(self.output.with_name(f"{self.task}_experts.jsonl"))
        with Evaluator(self.workers, log) as evaluator:
            expert = solved_seeds(evaluator, "expert", keys, template, self.seeds)
            open_loop = solved_seeds(evaluator, "open_loop", keys, template, self.seeds)
        with tqdm(total=len(missing) * len(self.seeds), unit="episode", smoothing=0) as bar:
            for key in missing:
                bar.set_description(f"{self.task}: {condition_name(*key)}")
                record = rollout.play(perturb_text(*key), self.records, bar.update)
                reference_condition = self.conditions.reference_condition(key)
                without_proof = {"first_met_tick": None, "proof": None}
                condition = PolicyCondition(
                    axis=key[0],
                    level=key[1],
                    world=record.world,
                    expert_solved=expert[reference_condition],
                    open_loop_solved=open_loop[reference_condition],
                    episodes=tuple(each.model_copy(update=without_proof) for each in record.episodes),
                )
                condition = self._with_expert_report(condition)
                result = self._write(result, [condition])
                yield condition

    def _check_worlds(self) -> None:
        """Refuse chosen conditions that were played or reported in other worlds than the present ones."""
        result, chosen = self.played(), [*self.conditions]
        played = result.by_key if result else {}
        reported = self.expert_report.by_key if self.expert_report else {}
        decisive = sorted({*map(self.conditions.reference_condition, chosen)} & reported.keys())
        with Evaluator(self.workers) as pool:
            here = self.conditions.worlds(sorted({*decisive} | ({*chosen} & played.keys())), pool)
        for key in sorted(here.keys() & played.keys()):
            check_same(self.output, f"world of {condition_name(*key)}", played[key].world, here[key])
        for key in decisive:
            if reported[key].world != here[key]:
                raise BimanualError(
                    f"the expert's report on {self.task} at {condition_name(*key)} is of world {reported[key].world}, but here "
                    f"it is {here[key]}; evaluate the expert again with `lerobot-bimanual expert evaluate --axes`"
                )

    def _with_expert_report(self, condition: PolicyCondition) -> PolicyCondition:
        """A condition with the expert's success on the many seeds of its report, if that has the condition."""
        report, key = self.expert_report, self.conditions.reference_condition(condition.key)
        if report is None or key not in report.by_key or condition.key not in [*self.conditions]:
            return condition
        return condition.model_copy(update={"expert_report": report.rates(report.by_key[key])["expert"]})

    def _write(
        self, earlier: RobustnessResult | None, conditions: Iterable[PolicyCondition]
    ) -> RobustnessResult:
        """Write and return the result with further or renewed conditions."""
        result = RobustnessResult(
            schema_version=3,
            config=self.config,
            checkpoint=earlier.checkpoint if earlier else str(self.checkpoint.folder),
            date=earlier.date if earlier else date.today().isoformat(),
            **merge_conditions(earlier, conditions, self.conditions),
        )
        if result != earlier:
            result.write(self.output)
        return result
