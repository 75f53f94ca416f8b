"""The page of all tasks, with what was measured."""

from pathlib import Path

from lerobot_bimanual.pages import render
from lerobot_env_bimanual.experts.world_version import joint_version
from lerobot_env_bimanual.reports.expert_tables import (
    EXACT,
    NOT_MEASURED,
    ROUNDED,
    ExpertReports,
    evidence_table,
    load_table,
    paper_table,
    success_table,
)


def tasks_page(reports: ExpertReports, folder: Path) -> str:
    """The page of all tasks.

    Args:
        reports: the expert reports.
        folder: their folder, as the page names it.
    """
    expert, rounded = reports.reports[EXACT], reports.reports.get(ROUNDED)
    return render(
        "lerobot_env_bimanual.reports",
        "tasks.md",
        folder=folder.as_posix(),
        world=joint_version(expert.worlds),
        expert=expert,
        voxels=rounded.discretise if rounded else NOT_MEASURED,
        success=success_table(reports),
        evidence=evidence_table(reports),
        loads=load_table(reports),
        paper=paper_table(reports),
    )
