"""Page of all tasks: what was measured of experts, baselines and arms."""

from __future__ import annotations

from pathlib import Path

from lerobot_bimanual.pages import render
from lerobot_env_bimanual.experts.world_version import joint_version
from lerobot_env_bimanual.reports.expert_tables import (
    EXACT,
    NOT_MEASURED,
    ROUNDED,
    ExpertReports,
    evidence_table,
    excess_sentence,
    load_table,
    paper_table,
    success_table,
)


def tasks_page(reports: ExpertReports, folder: Path) -> str:
    """The page as Markdown.

    Args:
        reports: the expert reports.
        folder: their folder, as the page names it.
    """
    expert = reports.reports[EXACT]
    rounded = reports.reports.get(ROUNDED)
    return render(
        "lerobot_env_bimanual.reports",
        "tasks.md",
        folder=folder.as_posix(),
        world=joint_version(expert.worlds),
        mujoco=expert.versions["mujoco"],
        split=expert.split,
        seeds=f"{expert.seeds.start} to {expert.seeds.stop - 1}",
        voxels=rounded.discretise if rounded else NOT_MEASURED,
        success=success_table(reports),
        evidence=evidence_table(reports),
        excess=excess_sentence(reports),
        strain=load_table(reports),
        paper=paper_table(reports),
    )
