"""The conditions of a task (every level of every axis that applies to it), sweeps of experts over them, and what sweeps share."""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.perturbation_levels import LEVELS
from lerobot_bimanual.results.record import Record
from lerobot_bimanual.results.robustness import (
    AxisRecord,
    Condition,
    ConditionKey,
    ExpertCondition,
    ExpertRobustnessConfig,
    ExpertRobustnessReport,
    RobustnessResult,
    perturb_text,
)
from lerobot_env_bimanual.episode.progress import draw_episode
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.options import ANY_VARIATION
from lerobot_env_bimanual.perturbations.axis import Axis
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.sweep.evaluator import EpisodeLog, EpisodeSpec, Evaluator
from lerobot_env_bimanual.tasks.registry import get_task
from lerobot_env_bimanual.workers import WorkerPool
from lerobot_env_bimanual.world.arena import build_spec


class NothingToChange(BimanualError):
    """No chosen axis of perturbations applies to a task."""


@dataclass(frozen=True)
class Conditions:
    """Chosen conditions of a task.

    Attributes:
        task: name of the task.
        axes: chosen axes that apply to the task, sorted by name.
        not_applicable: names of chosen axes that do not.
        levels: ascending levels of each axis; the nominal world is always added.
    """

    task: str
    axes: tuple[Axis, ...]
    not_applicable: tuple[str, ...]
    levels: tuple[int, ...]

    def __iter__(self) -> Iterator[ConditionKey]:
        """Axis and level of each condition: the nominal one, then by axis."""
        yield "", 0
        yield from ((axis.name, level) for axis in self.axes for level in self.levels)

    def reference_condition(self, key: ConditionKey) -> ConditionKey:
        """The condition that the expert and the open-loop baseline play: nominal for axes that change only observations."""
        is_only_seen = {axis.name: axis.changes_only_observations for axis in self.axes}
        return ("", 0) if is_only_seen.get(key[0]) else key

    @property
    def records(self) -> dict[str, AxisRecord]:
        """The axes as results keep them, by name."""
        return {
            axis.name: AxisRecord(name=axis.name, group=axis.group, unit=axis.unit, magnitudes=axis.levels)
            for axis in self.axes
        }

    def worlds(self, keys: Sequence[ConditionKey], pool: WorkerPool) -> dict[ConditionKey, str]:
        """Versions of the task's world in conditions, each found by an episode in a process of the pool."""
        perturbations = [perturb_text(*key) for key in keys]
        version, label = partial(world_version, self.task), f"{self.task}: worlds"
        found = pool.map(
            version, perturbations, label, "condition", name=lambda each: f"{self.task} {each}".strip()
        )
        return dict(zip(keys, found, strict=True))


def conditions_of(task: str, axes: Sequence[str] = (), levels: Sequence[int] = LEVELS) -> Conditions:
    """The conditions of a task at levels of axes; without axes, of all that apply but those for training.

    Raises:
        BimanualError: no such task, axis or level.
        NothingToChange: no axis applies to the task.
    """
    spec = get_task(task).spec
    for level in levels or [""]:
        if level not in LEVELS:
            raise InvalidChoice("levels", level, map(str, LEVELS))
    tests = [axis for axis in AXES.all().values() if not axis.for_training]
    chosen = [AXES.get(name) for name in sorted(set(axes))] or tests
    model = build_spec(spec.props)
    applicable = [axis for axis in chosen if axis.applies_to(spec, model)]
    if not applicable:
        raise NothingToChange(f"none of the axes {', '.join(axes)} finds anything to change in {task}")
    left_out = [axis.name for axis in chosen if axis not in applicable]
    return Conditions(task, tuple(applicable), tuple(left_out), tuple(sorted(set(levels))))


def solved_seeds(
    evaluator: Evaluator,
    player: Literal["expert", "open_loop"],
    conditions: Collection[ConditionKey],
    template: EpisodeSpec,
    seeds: Sequence[int],
) -> dict[ConditionKey, tuple[int, ...]]:
    """The seeds that the expert or the open-loop baseline solves in each condition, ascending.

    The expert is the replanning one. The open-loop baseline knows the variation, as a policy does from the instruction,
    and plays the mean keyposes of nominal training episodes. The `template` has task, variation and split of all of them.

    Raises:
        BimanualError: an episode could not be played.
    """
    task = get_task(template.task).spec
    fixed = task.variation_index(template.variation)
    specs: dict[tuple[ConditionKey, int], EpisodeSpec] = {}
    for key, seed in product(conditions, seeds):
        spec = replace(template, seed=seed, player="replanning", perturb=perturb_text(*key))
        if player == "open_loop":
            drawn = draw_episode(task, template.split, seed, fixed).variation.index
            spec = replace(spec, player=player, mean_keyposes=evaluator.mean_keyposes(task.name, str(drawn)))
        specs[key, seed] = spec
    outcomes = evaluator.play([*specs.values()], f"{template.task}: {player}")
    solved: dict[ConditionKey, tuple[int, ...]] = dict.fromkeys(conditions, ())
    for (key, seed), outcome in zip(specs, outcomes, strict=True):
        if outcome.success:
            solved[key] += (seed,)
    return solved


def read_earlier[Result: (RobustnessResult, ExpertRobustnessReport)](
    kind: type[Result], path: Path, config: Record, conditions: Conditions
) -> Result | None:
    """The result that an earlier run left in a file; None if there is none.

    Raises:
        BimanualError: the file is damaged, or holds another measurement.
    """
    if not path.exists():
        return None
    earlier, records = kind.read(path), conditions.records
    for name, ours in config:
        check_same(path, name, getattr(earlier.config, name), ours)
    for axis in earlier.axes:
        check_same(path, f"axis {axis.name}", axis, records.get(axis.name, axis))
    return earlier


def check_same(path: Path, name: str, theirs: object, ours: object) -> None:
    """Raise a `BimanualError` if the value called `name` in an earlier result differs from ours."""
    if theirs != ours:
        raise BimanualError(
            f"{path} has {name} {theirs!r}, but here it is {ours!r}; choose another --output, or remove the file to "
            "evaluate again"
        )


def merge_conditions(
    earlier: RobustnessResult | ExpertRobustnessReport | None,
    further: Iterable[Condition],
    chosen: Conditions,
) -> dict[str, Any]:
    """Axes and conditions of a result that has further conditions, as fields of the result."""
    axes, left_out, table = chosen.records, {*chosen.not_applicable}, dict[ConditionKey, Condition]()
    if earlier is not None:
        axes |= {axis.name: axis for axis in earlier.axes}
        left_out |= {*earlier.not_applicable}
        table |= earlier.by_key
    table |= {condition.key: condition for condition in further}
    return {
        "axes": tuple(axes[name] for name in sorted({axis for axis, _ in table if axis})),
        "not_applicable": tuple(sorted(left_out)),
        "conditions": tuple(table[key] for key in sorted(table)),
    }


def sweep_expert(
    conditions: Conditions, config: ExpertRobustnessConfig, output: Path, workers: int = 0
) -> ExpertRobustnessReport:
    """Play the conditions that no report in the file `output` holds for the present world, and write all of them.

    Conditions that are only seen are left out, since the players there act as in the nominal world.

    Raises:
        BimanualError: the file is damaged or of another measurement, or an episode could not be played.
    """
    keys = [key for key in conditions if conditions.reference_condition(key) == key]
    seeds = range(config.first_seed, config.first_seed + config.expert_episodes)
    log = EpisodeLog(output.with_suffix(".partial.jsonl"), exclusive=True)
    with Evaluator(workers, log) as evaluator:
        earlier = read_earlier(ExpertRobustnessReport, output, config, conditions)
        worlds = conditions.worlds(keys, evaluator)
        known = earlier.by_key if earlier else {}
        missing = [key for key in keys if key not in known or known[key].world != worlds[key]]
        template = EpisodeSpec(config.task, ANY_VARIATION, config.split, 0, "expert")
        few = seeds[: config.open_loop_episodes]
        expert = solved_seeds(evaluator, "expert", missing, template, seeds)
        open_loop = solved_seeds(evaluator, "open_loop", missing, template, few)
        found = [
            ExpertCondition(
                axis=axis,
                level=level,
                world=worlds[axis, level],
                expert_failed=tuple(seed for seed in seeds if seed not in expert[axis, level]),
                open_loop_solved=open_loop[axis, level],
            )
            for axis, level in missing
        ]
        report = ExpertRobustnessReport(
            schema_version=3, config=config, **merge_conditions(earlier, found, conditions)
        )
        report.write(output)
        log.remove()
    return report
