"""The page of the experts in perturbed conditions: they decide which conditions are valid."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from lerobot_bimanual.pages import render
from lerobot_bimanual.perturbation_levels import LEVELS
from lerobot_bimanual.results import robustness


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
    cells = overview.unstack().reindex(columns=LEVELS).fillna("")
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
