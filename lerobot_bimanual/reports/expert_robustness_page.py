"""Page of the experts' robustness: which conditions are valid for policies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from lerobot_bimanual.pages import render
from lerobot_bimanual.reports.robustness_page import LEVELS, magnitudes_text
from lerobot_bimanual.results.robustness import MIN_EXPERT_RATE, ExpertCondition, ExpertRobustnessReport

if TYPE_CHECKING:
    import pandas as pd


def expert_robustness_page(reports: Mapping[str, ExpertRobustnessReport]) -> str:
    """On how many tasks each condition is valid; then, per task, what expert and open-loop baseline solve.

    Args:
        reports: by task.
    """
    tasks = [
        {
            "name": task,
            "report": report,
            "nominal": report.rates(report.nominal),
            "table": _task_table(report),
        }
        for task, report in reports.items()
    ]
    return render(
        "lerobot_bimanual.reports",
        "expert_robustness.md",
        min_expert_rate=MIN_EXPERT_RATE,
        overview=_overview(reports),
        tasks=tasks,
    )


def _overview(reports: Mapping[str, ExpertRobustnessReport]) -> pd.DataFrame:
    import pandas as pd

    axes = sorted({axis.name for report in reports.values() for axis in report.axes})
    levels = {f"level {level}": [_valid_tasks(reports, axis, level) for axis in axes] for level in LEVELS}
    return pd.DataFrame({"axis": axes, **levels})


def _valid_tasks(reports: Mapping[str, ExpertRobustnessReport], axis: str, level: int) -> str:
    """Number of tasks on which a condition is valid, of those that have it; in brackets the others."""
    found = {
        task: report.is_valid(condition)
        for task, report in reports.items()
        if (condition := report.by_key.get((axis, level))) is not None
    }
    others = [task for task, is_valid in found.items() if not is_valid]
    counts = f"{len(found) - len(others)} of {len(found)}" if found else ""
    return f"{counts} (not {', '.join(others)})" if others else counts


def _task_table(report: ExpertRobustnessReport) -> pd.DataFrame:
    import pandas as pd

    labels = [f"{axis.name} ({magnitudes_text(axis)})" for axis in report.axes]
    levels = {
        f"level {level}": [_counts(report, report.by_key.get((axis.name, level))) for axis in report.axes]
        for level in LEVELS
    }
    return pd.DataFrame({"axis": labels, **levels})


def _counts(report: ExpertRobustnessReport, condition: ExpertCondition | None) -> str:
    """Expert and open-loop baseline, each of how many episodes; in brackets where the expert solves too few."""
    if condition is None:
        return ""
    rates = report.rates(condition)
    text = ", ".join(f"{rates[name].successes}/{rates[name].trials}" for name in ("expert", "open_loop"))
    return text if report.is_valid(condition) else f"({text})"
