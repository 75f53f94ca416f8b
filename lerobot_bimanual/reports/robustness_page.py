"""Page of the robustness of several policies, side by side."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from lerobot_bimanual.pages import render
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.reports.drops import SIGNIFICANT, Drop, drops_of, level_sums
from lerobot_bimanual.reports.trainings import Distance, Trainings, policy_name
from lerobot_bimanual.results.robustness import (
    MIN_EXPERT_RATE,
    NOMINAL,
    AxisRecord,
    RobustnessResult,
    condition_name,
    short_name,
)
from lerobot_bimanual.results.statistics import SuccessRate

if TYPE_CHECKING:
    import pandas as pd

type Results = Mapping[str, RobustnessResult]
"""Robustness results by name."""

LEVELS = range(1, MAX_LEVEL + 1)
ABSENT = "."


def robustness_page(results: Results, figure: str | None = None) -> str:
    """A section per task: successes of its policies at each level of each axis.

    Args:
        results: by name.
        figure: link to the heat map of these results; None for a page without.
    """
    spread, distances = _trainings(results)
    by_task: defaultdict[str, dict[str, RobustnessResult]] = defaultdict(dict)
    for name, result in results.items():
        by_task[result.task][name] = result
    return render(
        "lerobot_bimanual.reports",
        "robustness.md",
        significant=SIGNIFICANT,
        min_expert_rate=MIN_EXPERT_RATE,
        figure=figure,
        all_tasks=_all_tasks(results),
        spread=spread,
        distances=distances,
        tasks=[_task(task, by_task[task]) for task in sorted(by_task)],
    )


def _axis_names(results: Sequence[RobustnessResult]) -> list[str]:
    """Axes of any of the results, by group and name."""
    return [name for _, name in sorted({(axis.group, axis.name) for each in results for axis in each.axes})]


def _conditions(axes: Sequence[str]) -> dict[str, list[str]]:
    """Names of conditions by axis, the nominal one first."""
    return {NOMINAL: [NOMINAL]} | {axis: [condition_name(axis, level) for level in LEVELS] for axis in axes}


def _all_tasks(results: Results) -> pd.DataFrame | None:
    """Success on each condition over the tasks where it is valid, of every policy that was evaluated on several tasks."""
    import pandas as pd

    by_policy: defaultdict[str, list[RobustnessResult]] = defaultdict(list)
    for name, result in results.items():
        by_policy[policy_name(name, result)].append(result)
    table = {}
    for policy, found in by_policy.items():
        if (tasks := len({each.task for each in found})) > 1:
            trainings = f", {len(found)} trainings" if len(found) > tasks else ""
            table[f"{policy}, {tasks} tasks{trainings}"] = found
    if not table:
        return None
    conditions = _conditions(_axis_names([each for found in table.values() for each in found]))
    columns = {
        heading: [" ".join(_share(found, name) for name in names) for names in conditions.values()]
        for heading, found in table.items()
    }
    return pd.DataFrame({"axis": [*conditions], **columns})


def _share(results: Sequence[RobustnessResult], condition: str) -> str:
    """Percent solved of the episodes of a condition where it is valid."""
    found = [each.by_name[condition] for each in results if condition in each.by_name]
    rates = [each.rates["policy"] for each in found if each.is_valid]
    if not rates:
        return ABSENT
    return f"{sum(rate.successes for rate in rates) / sum(rate.trials for rate in rates):.0%}"


def _trainings(results: Results) -> tuple[pd.DataFrame | None, pd.DataFrame | None]:
    """How far trainings of one policy are apart axis by axis, and how far policies are over all conditions."""
    import pandas as pd

    trainings = Trainings(results)
    policies = trainings.policies
    if not policies:
        return None, None
    conditions = _conditions(_axis_names([*results.values()]))
    every = [name for names in conditions.values() for name in names]
    spread = {
        policy: [
            " ".join(_mean(trainings.apart(policy, policy, [name])) for name in names)
            for names in conditions.values()
        ]
        for policy in policies
    }
    distances = {
        second: [_largest(trainings.apart(first, second, every)) for first in policies] for second in policies
    }
    return pd.DataFrame({"axis": [*conditions], **spread}), pd.DataFrame({"": policies, **distances})


def _mean(distance: Distance) -> str:
    return f"{distance.mean:.0%}" if distance.pairs else ABSENT


def _largest(distance: Distance) -> str:
    return f"{_mean(distance)} ({distance.largest:.0%})" if distance.pairs else ABSENT


def _task(task: str, results: Results) -> dict[str, Any]:
    """What the page says of one task."""
    import pandas as pd

    axes = {axis.name: axis for result in results.values() for axis in result.axes}
    names = _axis_names([*results.values()])
    labels = ["nominal", *(f"{name} ({magnitudes_text(axes[name])})" for name in names)]
    labels += [f"valid conditions of level {level}" for level in LEVELS]
    columns, lines = {}, []
    for name, result in results.items():
        drops, sums, nominal = drops_of(result), level_sums(result), result.nominal
        played = {axis.name for axis in result.axes}
        columns[short_name(name, result)] = [
            counts_text(nominal.rates["policy"]),
            *(
                " ".join(_cell(drops.get(condition_name(axis, level))) for level in LEVELS)
                if axis in played
                else ""
                for axis in names
            ),
            *(counts_text(sums[level]) if level in sums else "" for level in LEVELS),
        ]
        lines.append(
            f"{name}: {result.policy}, weights {result.config.checkpoint_sha256[:12]}, {result.config.options['split']} seeds "
            f"{nominal.seeds[0]} to {nominal.seeds[-1]}, batches of {result.config.batch_size}; nominal: expert "
            f"{counts_text(nominal.rates['expert'])}, open loop {counts_text(nominal.rates['open_loop'])}."
        )
    return {
        "name": task,
        "table": pd.DataFrame({"axis": labels, **columns}),
        "lines": lines,
        "not_applicable": sorted({axis for result in results.values() for axis in result.not_applicable}),
    }


def magnitudes_text(axis: AxisRecord) -> str:
    """Magnitudes of the levels of an axis, with their unit."""
    return f"{', '.join(f'{magnitude:g}' for magnitude in axis.magnitudes)} {axis.unit}"


def counts_text(rate: SuccessRate) -> str:
    """Successes and episodes, without an interval."""
    return f"{rate.successes} of {rate.trials}"


def _cell(drop: Drop | None) -> str:
    """Successes; in bold where they differ from nominal; in brackets where the condition is not valid."""
    if drop is None:
        return ABSENT
    solved = str(drop.condition.rates["policy"].successes)
    if drop.p_holm is None:
        return f"({solved})"
    return f"**{solved}**" if drop.is_significant else solved
