"""Pages of robustness: several policies side by side, and the experts, who decide which conditions are valid."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from lerobot_bimanual.pages import render
from lerobot_bimanual.reports import robustness_table
from lerobot_bimanual.results import robustness

type Results = Mapping[str, robustness.RobustnessResult]
"""Robustness results by name."""


def robustness_page(results: Results) -> str:
    """What perturbations cost policies, over all their tasks.

    Args:
        results: by name.
    """
    table = robustness_table.conditions_table(results)
    return render(
        "lerobot_bimanual.reports",
        "robustness.md",
        min_expert_rate=robustness.MIN_EXPERT_RATE,
        success=_success(table),
    )


def _success(table: pd.DataFrame) -> pd.DataFrame:
    """Success on each condition over the tasks where it is valid, a column per policy."""
    counts = table.groupby("policy")[["task", "result"]].nunique()
    headings = {
        policy: f"{policy}, {tasks} tasks" + (f", {trainings} trainings" if trainings > tasks else "")
        for policy, (tasks, trainings) in zip(counts.index, counts.to_numpy(), strict=True)
    }
    sums = table[table.valid].groupby(["condition", "policy"])[["solved", "n"]].sum()
    cells = (sums.solved / sums.n).map("{:.0%}".format).unstack()
    return robustness_table.by_axis(cells.rename(columns=headings), robustness_table.axis_names(table))


def expert_robustness_page(reports: Mapping[str, robustness.ExpertRobustnessReport]) -> str:
    """On how many tasks each condition is valid.

    Args:
        reports: by task.
    """
    table = pd.DataFrame(
        {
            "task": task,
            "axis": each.axis,
            "level": each.level,
            "valid": robustness.is_valid(report.rates(each)["expert"]),
        }
        for task, report in reports.items()
        for each in report.conditions[1:]
    )
    overview = pd.Series({key: _valid_tasks(lines) for key, lines in table.groupby(["axis", "level"])})
    cells = overview.unstack().reindex(columns=robustness_table.LEVELS).fillna("")
    return render(
        "lerobot_bimanual.reports",
        "expert_robustness.md",
        min_expert_rate=robustness.MIN_EXPERT_RATE,
        overview=cells.add_prefix("level ").rename_axis("axis").reset_index(),
    )


def _valid_tasks(lines: pd.DataFrame) -> str:
    """Number of tasks on which a condition is valid, of those that have it; in brackets the others."""
    counts = f"{lines.valid.sum()} of {len(lines)}"
    return counts if lines.valid.all() else f"{counts} (not {', '.join(lines.task[~lines.valid])})"
