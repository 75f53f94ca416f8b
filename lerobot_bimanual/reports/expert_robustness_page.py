"""Page of the experts' robustness: which conditions are valid for policies."""

# pyright: reportArgumentType=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportIndexIssue=false
# The types of pandas do not tell a frame from a series where it is indexed or grouped.

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from lerobot_bimanual.pages import render
from lerobot_bimanual.reports.robustness_page import magnitudes_text
from lerobot_bimanual.reports.robustness_table import LEVELS
from lerobot_bimanual.results.robustness import MIN_EXPERT_RATE, ExpertCondition, ExpertRobustnessReport


def expert_robustness_page(reports: Mapping[str, ExpertRobustnessReport]) -> str:
    """On how many tasks each condition is valid; then, per task, what expert and open-loop baseline solve.

    Args:
        reports: by task.
    """
    table = pd.DataFrame(
        {
            "task": task,
            "axis": each.axis,
            "level": each.level,
            "valid": report.is_valid(each),
            "text": _counts(report, each),
        }
        for task, report in reports.items()
        for each in report.conditions[1:]
    )
    tasks = []
    for task, report in reports.items():
        cells = _by_level(table[table.task == task].set_index(["axis", "level"]).text)
        magnitudes = {axis.name: f"{axis.name} ({magnitudes_text(axis)})" for axis in report.axes}
        nominal = report.rates(report.nominal)
        tasks.append(
            {"name": task, "report": report, "nominal": nominal, "table": cells.replace({"axis": magnitudes})}
        )
    return render(
        "lerobot_bimanual.reports",
        "expert_robustness.md",
        min_expert_rate=MIN_EXPERT_RATE,
        overview=_by_level(
            pd.Series({key: _valid_tasks(lines) for key, lines in table.groupby(["axis", "level"])})
        ),
        tasks=tasks,
    )


def _by_level(texts: pd.Series) -> pd.DataFrame:
    """Texts by axis and level as a table with a line per axis."""
    cells = texts.unstack().reindex(columns=LEVELS).fillna("").add_prefix("level ")
    return cells.rename_axis("axis").reset_index()


def _valid_tasks(lines: pd.DataFrame) -> str:
    """Number of tasks on which a condition is valid, of those that have it; in brackets the others."""
    counts = f"{lines.valid.sum()} of {len(lines)}"
    return counts if lines.valid.all() else f"{counts} (not {', '.join(lines.task[~lines.valid])})"


def _counts(report: ExpertRobustnessReport, condition: ExpertCondition) -> str:
    """Expert and open-loop baseline, each of how many episodes; in brackets where the expert solves too few."""
    rates = report.rates(condition)
    text = ", ".join(f"{rates[name].successes}/{rates[name].trials}" for name in ("expert", "open_loop"))
    return text if report.is_valid(condition) else f"({text})"
