"""Page of the experts' robustness: which conditions are valid for policies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from lerobot_bimanual.ladder.result import LEAST_EXPERT_RATE
from lerobot_bimanual.ladder.rung_certificate import CertifiedRung, RungCertificate
from lerobot_bimanual.pages import render
from lerobot_bimanual.reports.robustness_page import LEVELS, magnitudes_text

if TYPE_CHECKING:
    import pandas as pd


def expert_robustness_page(reports: Mapping[str, RungCertificate]) -> str:
    """On how many tasks each condition is valid; then, per task, what expert and open-loop baseline solve.

    Args:
        reports: by task.
    """
    tasks = [
        {
            "name": task,
            "report": report,
            "nominal": report.rates(report.rungs[0]),
            "table": _task_table(report),
        }
        for task, report in reports.items()
    ]
    return render(
        "lerobot_bimanual.reports",
        "expert_robustness.md",
        min_expert_rate=LEAST_EXPERT_RATE,
        overview=_overview(reports),
        tasks=tasks,
    )


def _overview(reports: Mapping[str, RungCertificate]) -> pd.DataFrame:
    import pandas as pd

    axes = sorted({axis.name for report in reports.values() for axis in report.axes})
    levels = {f"level {level}": [_valid_tasks(reports, axis, level) for axis in axes] for level in LEVELS}
    return pd.DataFrame({"axis": axes, **levels})


def _valid_tasks(reports: Mapping[str, RungCertificate], axis: str, level: int) -> str:
    """Number of tasks on which a condition is valid, of those that have it; in brackets the others."""
    found = {
        task: report.is_certified(rung)
        for task, report in reports.items()
        if (rung := report.find(axis, level)) is not None
    }
    others = [task for task, is_valid in found.items() if not is_valid]
    counts = f"{len(found) - len(others)} of {len(found)}" if found else ""
    return f"{counts} (not {', '.join(others)})" if others else counts


def _task_table(report: RungCertificate) -> pd.DataFrame:
    import pandas as pd

    labels = [f"{axis.name} ({magnitudes_text(axis)})" for axis in report.axes]
    levels = {
        f"level {level}": [_counts(report, report.find(axis.name, level)) for axis in report.axes]
        for level in LEVELS
    }
    return pd.DataFrame({"axis": labels, **levels})


def _counts(report: RungCertificate, rung: CertifiedRung | None) -> str:
    """Expert and open-loop baseline, each of how many episodes; in brackets where the expert solves too few."""
    if rung is None:
        return ""
    rates = report.rates(rung)
    text = ", ".join(f"{rates[name].successes}/{rates[name].trials}" for name in ("expert", "blind"))
    return text if report.is_certified(rung) else f"({text})"
