"""Ladders of several policies as parts of a page."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain

from lerobot_bimanual.ladder.falls import Fall, falls, level_sums
from lerobot_bimanual.ladder.result import (
    LEAST_EXPERT_RATE,
    LEVEL_0,
    AxisRecord,
    LadderResult,
    rung_name,
    short_name,
)
from lerobot_bimanual.ladder.trainings import Distance, Trainings, policy_name
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.results.statistics import SuccessRate

UPPER_LEVELS = range(1, MAX_LEVEL + 1)
SURE = 0.05
HEADING = "# What policies survive\n"
LEGEND = (
    "Per task, policies side by side: episodes solved at levels 1, 2 and 3 of each axis, and above them at level 0. In bold: "
    "differs from level 0 on the same episodes, McNemar's exact test with p up to 0.05 as corrected by Holm for how many axes "
    "have a certified rung of that level. In brackets: not certified, since the expert solves less than "
    f"{LEAST_EXPERT_RATE:.0%}; counted in no sum. A point: not played.\n"
)
"""Of the tables of ladders."""


def render(ladders: Mapping[str, LadderResult]) -> str:
    """A section per task: successes of its policies at each level of each axis, and what is lost against level 0.

    Args:
        ladders: by name.
    """
    by_task: dict[str, dict[str, LadderResult]] = {}
    for name, ladder in ladders.items():
        by_task.setdefault(ladder.task, {})[name] = ladder
    tasks = ("\n".join(_task(task, by_task[task])) for task in sorted(by_task))
    return "\n".join((*_all_tasks(ladders), *_trainings(ladders), *tasks))


def _all_tasks(ladders: Mapping[str, LadderResult]) -> Iterator[str]:
    """Success on each rung over the tasks where it is certified, of every policy that has a ladder on several."""
    of_policy: dict[str, list[LadderResult]] = {}
    for name, ladder in ladders.items():
        of_policy.setdefault(policy_name(name, ladder), []).append(ladder)
    several = {name: found for name, found in of_policy.items() if len(_tasks(found)) > 1}
    if not several:
        return
    yield "### All tasks\n"
    yield (
        "Percent of the episodes solved at levels 1, 2 and 3, over the trainings of a policy and its tasks where the rung is certified "
        "and the axis has anything to change; above them at level 0, over all its tasks.\n"
    )
    axes = sorted(
        {(axis.group, axis.name) for found in several.values() for each in found for axis in each.axes}
    )
    rows = [["level 0", *(_share(found, LEVEL_0) for found in several.values())]]
    for _, axis in axes:
        rungs = [rung_name(axis, level) for level in UPPER_LEVELS]
        rows.append([axis, *(" ".join(_share(found, rung) for rung in rungs) for found in several.values())])
    yield markdown_table(["axis", *(_heading(name, found) for name, found in several.items())], rows) + "\n"


def _tasks(ladders: Iterable[LadderResult]) -> set[str]:
    return {ladder.task for ladder in ladders}


def _heading(policy: str, ladders: Sequence[LadderResult]) -> str:
    tasks = len(_tasks(ladders))
    return f"{policy}, {tasks} tasks" + (f", {len(ladders)} trainings" if len(ladders) > tasks else "")


def _trainings(ladders: Mapping[str, LadderResult]) -> Iterator[str]:
    """How far trainings of one policy are apart, then how far policies are."""
    trainings = Trainings(ladders)
    if not trainings.policies:
        return
    axes = sorted({(axis.group, axis.name) for ladder in ladders.values() for axis in ladder.axes})
    rungs = {LEVEL_0: [LEVEL_0]}
    rungs |= {axis: [rung_name(axis, level) for level in UPPER_LEVELS] for _, axis in axes}
    every = [*chain.from_iterable(rungs.values())]
    rows = [
        [
            name,
            *(
                " ".join(_apart(trainings.apart(policy, policy, [rung])) for rung in of_axis)
                for policy in trainings.policies
            ),
        ]
        for name, of_axis in rungs.items()
    ]
    yield "### Trainings of one policy\n"
    yield (
        "Of what two trainings of one policy solve of the same episodes, the absolute difference in percent of them, at levels 1, 2 "
        "and 3, in the mean over tasks and pairs. Ladders whose names differ in `_seed` and a number are trainings of one policy.\n"
    )
    yield markdown_table(["axis", *trainings.policies], rows) + "\n"
    yield (
        "The same over all rungs, and in brackets on the rung where it is largest: two trainings of one policy, and a training of one "
        "beside one of another. Policies that are no further apart than their trainings are not told apart.\n"
    )
    matrix = [
        [first, *(_furthest(trainings.apart(first, second, every)) for second in trainings.policies)]
        for first in trainings.policies
    ]
    yield markdown_table(["", *trainings.policies], matrix) + "\n"


def _apart(distance: Distance) -> str:
    return f"{distance.mean:.0%}" if distance.pairs else "."


def _furthest(distance: Distance) -> str:
    return f"{_apart(distance)} ({distance.largest:.0%})" if distance.pairs else "."


def _share(ladders: Sequence[LadderResult], name: str) -> str:
    """Percent solved of the episodes of a rung where it is certified; a point where it is nowhere."""
    rungs = [ladder.by_name[name] for ladder in ladders if name in ladder.by_name]
    rates = [rung.rates["policy"] for rung in rungs if rung.is_certified]
    if not rates:
        return "."
    return f"{sum(rate.successes for rate in rates) / sum(rate.trials for rate in rates):.0%}"


def _task(task: str, ladders: Mapping[str, LadderResult]) -> Iterator[str]:
    yield f"### {task}\n"
    found = {name: falls(ladder) for name, ladder in ladders.items()}
    axes = {
        (axis.group, axis.name, magnitudes_text(axis)) for ladder in ladders.values() for axis in ladder.axes
    }
    rows = [["level 0", *(counts_text(ladder.level_0.rates["policy"]) for ladder in ladders.values())]]
    for _, axis, magnitudes in sorted(axes):
        rungs = [f"{axis}:{level}" for level in UPPER_LEVELS]
        played = [axis in (each.name for each in ladder.axes) for ladder in ladders.values()]
        cells = [
            " ".join(_cell(found[name].get(rung)) for rung in rungs) if has_axis else ""
            for name, has_axis in zip(ladders, played, strict=True)
        ]
        rows.append([f"{axis} ({magnitudes})", *cells])
    for level in UPPER_LEVELS:
        sums = [level_sums(ladder).get(level) for ladder in ladders.values()]
        rows.append(
            [f"certified rungs of level {level}", *(counts_text(rate) if rate else "" for rate in sums)]
        )
    short = [short_name(name, ladder) for name, ladder in ladders.items()]
    yield markdown_table(["axis", *short], rows) + "\n"
    for name, ladder in ladders.items():
        rates, seeds = ladder.level_0.rates, ladder.level_0.seeds
        yield (
            f"- {name}: {ladder.policy}, weights {ladder.checkpoint_sha256[:12]}, {ladder.options['split']} seeds {seeds[0]} "
            f"to {seeds[-1]}, batches of {ladder.batch_size}; at level 0 expert {counts_text(rates['expert'])}, blind "
            f"{counts_text(rates['blind'])}."
        )
    without = sorted({axis for ladder in ladders.values() for axis in ladder.not_applicable})
    yield f"\nNot applicable: {', '.join(without)}.\n" if without else ""


def magnitudes_text(axis: AxisRecord) -> str:
    """What the levels of an axis are."""
    return f"{', '.join(f'{magnitude:g}' for magnitude in axis.magnitudes)} {axis.unit}"


def counts_text(rate: SuccessRate) -> str:
    """Successes of how many, without an interval."""
    return f"{rate.successes} of {rate.trials}"


def _cell(fall: Fall | None) -> str:
    """Successes; in bold where they differ from level 0; in brackets where the rung is not certified."""
    if fall is None:
        return "."
    solved = str(fall.rung.rates["policy"].successes)
    if fall.p_holm is None:
        return f"({solved})"
    return f"**{solved}**" if fall.p_holm <= SURE else solved
