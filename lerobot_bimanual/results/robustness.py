"""Sweeps over conditions: a policy, or the expert, at every level of every perturbation axis of a task, as JSON files."""

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, NonNegativeInt, PositiveInt, model_validator

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.results.episode import EpisodeCount, Episodes, Sha256, success_rate
from lerobot_bimanual.results.evaluation import WorldVersion
from lerobot_bimanual.results.record import Name, Record, Text, require
from lerobot_bimanual.results.statistics import SuccessRate

MIN_EXPERT_RATE = 0.97
"""Minimum success rate of the expert on a valid condition; below it, a policy's failure says nothing about the policy."""

type ConditionKey = tuple[str, int]
"""Axis and level of a condition; ("", 0) in the nominal world."""


class AxisRecord(Record):
    """A perturbation axis as it was when it was evaluated, with the magnitudes of its levels 1, 2 and 3."""

    name: Name
    group: Name
    unit: Text
    magnitudes: tuple[float, float, float]


class Condition(Record):
    """One level, 1 to 3, of one axis, or the nominal world, which has no axis and is no level (0)."""

    axis: Name | Literal[""] = ""
    level: Annotated[int, Field(ge=0, le=MAX_LEVEL)] = 0
    world: WorldVersion

    @property
    def key(self) -> ConditionKey:
        """Axis and level."""
        return self.axis, self.level

    @property
    def name(self) -> str:
        """The condition as `--env.perturb` takes it, or "nominal"."""
        return condition_name(self.axis, self.level)


class PolicyCondition(Condition):
    """A policy, the expert and the open-loop baseline on the same episodes of one condition.

    Attributes:
        expert_solved: seeds that the expert solved.
        open_loop_solved: seeds that the open-loop baseline solved.
        expert_report: the expert on the seeds of its robustness report, if there was one; it then decides on validity.
        episodes: the policy's episodes.
    """

    expert_solved: tuple[int, ...] = ()
    open_loop_solved: tuple[int, ...] = ()
    expert_report: SuccessRate | None = None
    episodes: Episodes

    @property
    def rates(self) -> dict[str, SuccessRate]:
        """Success of `policy`, `expert` and `open_loop`."""
        n = len(self.episodes)
        return {
            "policy": success_rate(self.episodes),
            "expert": SuccessRate(len(self.expert_solved), n),
            "open_loop": SuccessRate(len(self.open_loop_solved), n),
        }

    @property
    def is_valid(self) -> bool:
        """Whether the expert solves enough for a failure of the policy to mean something."""
        return is_valid(self.expert_report or self.rates["expert"])


class _SweepConfig(Record):
    """What a sweep measures, from `first_seed` on in every condition; equal configs are the same measurement."""

    task: Name
    first_seed: NonNegativeInt = 0
    versions: dict[str, str]


class RobustnessConfig(_SweepConfig):
    """What a sweep of a policy measures.

    Attributes:
        policy: type of the policy.
        checkpoint_sha256: of its `model.safetensors`.
        options: of the nominal environment, by name.
        episodes: of each condition, on consecutive seeds.
        batch_size: environments side by side.
        policy_flags: device and precision, where they are not the checkpoint's.
    """

    policy: Name
    checkpoint_sha256: Sha256
    options: dict[str, str]
    episodes: EpisodeCount
    batch_size: PositiveInt
    policy_flags: tuple[str, ...] = ()


class _Sweep[Config: _SweepConfig, Each: Condition](Record):
    """Conditions of one task, the nominal one first, then by axis and level, and their axes, sorted by name.

    Axes that find nothing to change in the task are not applicable.
    """

    schema_version: Literal[3]
    config: Config
    axes: tuple[AxisRecord, ...] = ()
    not_applicable: tuple[Name, ...] = ()
    conditions: tuple[Each, ...]

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.config.task

    @property
    def nominal(self) -> Each:
        """The condition that nothing perturbs."""
        return self.conditions[0]

    @cached_property
    def by_key(self) -> Mapping[ConditionKey, Each]:
        """Conditions by axis and level."""
        return {condition.key: condition for condition in self.conditions}


class RobustnessResult(_Sweep[RobustnessConfig, PolicyCondition]):
    """One policy on the conditions of one task, each on the same episodes; the date is that of the first condition."""

    checkpoint: str
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        require(self.conditions and not self.nominal.axis, "the nominal condition must come first")
        seeds = [*range(self.config.first_seed, self.config.first_seed + self.config.episodes)]
        for each in self.conditions:
            same = [episode.seed for episode in each.episodes] == seeds
            require(same, f"{each.name} must be on the {len(seeds)} seeds from {self.config.first_seed} on")
        return self


class ExpertCondition(Condition):
    """The expert and the open-loop baseline on one condition: the seeds that each of them failed, or solved."""

    expert_failed: tuple[int, ...] = ()
    open_loop_solved: tuple[int, ...] = ()


class ExpertRobustnessConfig(_SweepConfig):
    """What a sweep of the expert measures, on consecutive seeds; the open-loop baseline has the first of them."""

    split: Literal["train", "val", "test"]
    expert_episodes: EpisodeCount
    open_loop_episodes: EpisodeCount


class ExpertRobustnessReport(_Sweep[ExpertRobustnessConfig, ExpertCondition]):
    """The expert and the open-loop baseline on all conditions of one task that change what happens."""

    def rates(self, condition: ExpertCondition) -> dict[str, SuccessRate]:
        """Success of `expert` and `open_loop`."""
        expert, open_loop = self.config.expert_episodes, self.config.open_loop_episodes
        return {
            "expert": SuccessRate(expert - len(condition.expert_failed), expert),
            "open_loop": SuccessRate(len(condition.open_loop_solved), open_loop),
        }


def is_valid(expert: SuccessRate) -> bool:
    """Whether a condition on which the expert has this success counts."""
    return expert.successes >= MIN_EXPERT_RATE * expert.trials


def condition_name(axis: str, level: int) -> str:
    """A condition as `--env.perturb` takes it, or "nominal"."""
    return perturb_text(axis, level) or "nominal"


def perturb_text(axis: str, level: int) -> str:
    """A condition as the option `perturb` takes it; empty in the nominal world."""
    return f"{axis}:{level}" if axis else ""


def read_expert_robustness(folder: Path) -> dict[str, ExpertRobustnessReport]:
    """The expert robustness reports in a folder, by task.

    Raises:
        BimanualError: there are none, one cannot be read, or two are of one task.
    """
    found: dict[str, ExpertRobustnessReport] = {}
    for path in sorted(folder.glob("*.json")):
        report = ExpertRobustnessReport.read(path)
        if report.task in found:
            raise BimanualError(f"{path} is another report of {report.task}; a folder must hold one per task")
        found[report.task] = report
    if not found:
        raise BimanualError(
            f"{folder} holds no robustness reports of the expert; `lerobot-bimanual expert evaluate --axes=all "
            f"--output={folder}` writes them"
        )
    return found
