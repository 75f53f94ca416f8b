"""Page of all tasks: what was measured of experts, baselines and arms."""

from __future__ import annotations

from pathlib import Path

from lerobot_bimanual.pages import render
from lerobot_env_bimanual.experts.world_version import joint_version
from lerobot_env_bimanual.reports.certified import (
    EXACT,
    NOT_MEASURED,
    ROUNDED,
    Certified,
    evidence_table,
    excess_sentence,
    paper_table,
    strain_table,
    success_table,
)


def tasks_page(certified: Certified, folder: Path) -> str:
    """The page as Markdown.

    Args:
        certified: the certificates.
        folder: that holds them, for the page to say.
    """
    expert = certified.certificates[EXACT]
    rounded = certified.certificates.get(ROUNDED)
    return render(
        "lerobot_env_bimanual.reports",
        "tasks.md",
        folder=folder.as_posix(),
        world=joint_version(expert.worlds),
        mujoco=expert.versions["mujoco"],
        split=expert.campaign.split,
        seeds=expert.campaign.seeds,
        voxels=rounded.campaign.discretise if rounded else NOT_MEASURED,
        success=success_table(certified),
        evidence=evidence_table(certified),
        excess=excess_sentence(certified),
        strain=strain_table(certified),
        paper=paper_table(certified),
    )
