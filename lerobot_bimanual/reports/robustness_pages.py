"""Pages of robustness: several policies side by side, and the experts, who decide which conditions are valid."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from lerobot_bimanual.pages import render
from lerobot_bimanual.reports import robustness_table
from lerobot_bimanual.results import robustness

type Results = Mapping[str, robustness.RobustnessResult]
"""Robustness results by name."""


def robustness_page(results: Results) -> str:
    """What perturbations cost policies, over all tasks; of one task alone, the successes in each condition.

    Args:
        results: by name.
    """
    table = robustness_table.conditions_table(results)
    return render(
        "lerobot_bimanual.reports",
        "robustness.md",
        significant=robustness_table.SIGNIFICANT,
        min_expert_rate=robustness.MIN_EXPERT_RATE,
        all_tasks=_all_tasks(table),
        distances=_distances(table),
        task=_task(table, results) if table.task.nunique() == 1 else None,
    )


def _all_tasks(table: pd.DataFrame) -> pd.DataFrame | None:
    """Success on each condition over the tasks where it is valid, of every policy that was evaluated on several tasks."""
    counts = table.groupby("policy")[["task", "result"]].nunique()
    counts = counts[counts.task > 1]
    if counts.empty:
        return None
    headings = {
        policy: f"{policy}, {tasks} tasks" + (f", {trainings} trainings" if trainings > tasks else "")
        for policy, (tasks, trainings) in zip(counts.index, counts.to_numpy(), strict=True)
    }
    shown = table[table.policy.isin(headings)]
    sums = shown[shown.valid].groupby(["condition", "policy"])[["solved", "n"]].sum()
    cells = (sums.solved / sums.n).map("{:.0%}".format).unstack()
    return robustness_table.by_axis(cells.rename(columns=headings), robustness_table.axis_names(shown))


def _distances(table: pd.DataFrame) -> pd.DataFrame | None:
    """How far trainings of one policy, and of two policies, are apart over all conditions.

    Differences are those of two trainings on the same episodes of the same task and world, where the condition is valid.
    """
    trained = table.drop_duplicates(["task", "policy", "checkpoint", "condition"])
    several = trained[trained.groupby(["task", "policy"]).checkpoint.transform("nunique") > 1]
    policies = sorted(several.policy.unique())
    if not policies:
        return None
    valid = several[several.valid]
    pairs = valid.merge(valid, on=["task", "condition", "world", "seeds", "n"], suffixes=("", "_other"))
    is_pair = (pairs.policy != pairs.policy_other) | (pairs.checkpoint < pairs.checkpoint_other)
    pairs = pairs[is_pair].assign(apart=lambda pairs: (pairs.solved - pairs.solved_other).abs() / pairs.n)
    over_all = pairs.groupby(["policy", "policy_other"]).apart.agg(["mean", "max"])
    texts = over_all.apply(lambda line: f"{line['mean']:.0%} ({line['max']:.0%})", axis=1).unstack()
    return texts.reindex(policies)[policies].fillna(".").rename_axis("").reset_index()


def _task(table: pd.DataFrame, results: Results) -> dict[str, Any]:
    """What the page says of the only task."""
    records = {axis.name: axis for result in results.values() for axis in result.axes}
    labels = table.label.drop_duplicates()
    cells = table.assign(text=table.apply(_cell, axis=1)).pivot(
        index="condition", columns="label", values="text"
    )
    shown = robustness_table.by_axis(cells[labels], robustness_table.axis_names(table))
    shown["axis"] = [
        f"{name} ({magnitudes_text(records[name])})" if name in records else name for name in shown.axis
    ]
    sums = table[table.valid & (table.level > 0)].groupby(["level", "label"])[["solved", "n"]].sum()
    totals = sums.apply(lambda line: f"{line.solved} of {line.n}", axis=1).unstack()
    totals = totals.reindex(index=robustness_table.LEVELS, columns=labels).fillna("")
    totals.insert(0, "axis", [f"valid conditions of level {level}" for level in robustness_table.LEVELS])
    lines = [
        f"{line.result}: {results[line.result].policy}, weights {line.checkpoint[:12]}, "
        f"{results[line.result].config.options['split']} seeds {line.seeds[0]} to {line.seeds[-1]}, batches of "
        f"{results[line.result].config.batch_size}; nominal: expert {line.expert} of {line.n}, open loop {line.open_loop} of "
        f"{line.n}."
        for line in table[table.level == 0].itertuples()
    ]
    without = sorted({axis for result in results.values() for axis in result.not_applicable})
    shown, name = pd.concat([shown, totals]), table.task.iloc[0]
    return {"name": name, "table": shown, "lines": lines, "not_applicable": without}


def expert_robustness_page(reports: Mapping[str, robustness.ExpertRobustnessReport]) -> str:
    """On how many tasks each condition is valid; of one task alone, what expert and open-loop baseline solve.

    Args:
        reports: by task.
    """
    table = pd.DataFrame(
        {
            "task": task,
            "axis": each.axis,
            "level": each.level,
            "valid": robustness.is_valid(report.rates(each)["expert"]),
            "text": _counts(report, each),
        }
        for task, report in reports.items()
        for each in report.conditions[1:]
    )
    overview = pd.Series({key: _valid_tasks(lines) for key, lines in table.groupby(["axis", "level"])})
    first, report = next(iter(reports.items()))
    solved = _by_level(table[table.task == first].set_index(["axis", "level"]).text)
    magnitudes = {axis.name: f"{axis.name} ({magnitudes_text(axis)})" for axis in report.axes}
    return render(
        "lerobot_bimanual.reports",
        "expert_robustness.md",
        min_expert_rate=robustness.MIN_EXPERT_RATE,
        tasks=len(reports),
        overview=_by_level(overview),
        report=report,
        nominal=report.rates(report.nominal),
        solved=solved.replace({"axis": magnitudes}),
    )


def _by_level(texts: pd.Series) -> pd.DataFrame:
    """Texts by axis and level as a table with a line per axis."""
    cells = texts.unstack().reindex(columns=robustness_table.LEVELS).fillna("").add_prefix("level ")
    return cells.rename_axis("axis").reset_index()


def _valid_tasks(lines: pd.DataFrame) -> str:
    """Number of tasks on which a condition is valid, of those that have it; in brackets the others."""
    counts = f"{lines.valid.sum()} of {len(lines)}"
    return counts if lines.valid.all() else f"{counts} (not {', '.join(lines.task[~lines.valid])})"


def _counts(report: robustness.ExpertRobustnessReport, condition: robustness.ExpertCondition) -> str:
    """Expert and open-loop baseline, each of how many episodes; in brackets where the expert solves too few."""
    rates = report.rates(condition)
    text = ", ".join(f"{rates[name].successes}/{rates[name].trials}" for name in ("expert", "open_loop"))
    return text if robustness.is_valid(rates["expert"]) else f"({text})"


def magnitudes_text(axis: robustness.AxisRecord) -> str:
    """Magnitudes of the levels of an axis, with their unit."""
    return f"{', '.join(f'{magnitude:g}' for magnitude in axis.magnitudes)} {axis.unit}"


def _cell(line: pd.Series) -> str:
    """Successes; in bold where they differ from nominal; in brackets where the condition is not valid."""
    if line.level == 0:
        return f"{line.solved} of {line.n}"
    if not line.valid:
        return f"({line.solved})"
    return f"**{line.solved}**" if line.p_holm <= robustness_table.SIGNIFICANT else f"{line.solved}"
