"""The page of all tasks, with what was measured."""

from pathlib import Path

from lerobot_bimanual.pages import render
from lerobot_env_bimanual.experts.world_version import joint_version
from lerobot_env_bimanual.options import SETTINGS, STANDARD
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


def tasks_page(folder: Path) -> str:
    """The page of all tasks, in all settings that have reports.

    Args:
        folder: holds a folder of expert reports per setting.

    Raises:
        BimanualError: there is no report of `standard`, or one of the reports is wrong.
    """
    chosen = [name for name in SETTINGS if name == STANDARD or (folder / name).is_dir()]
    reports = {name: ExpertReports.read(folder / name) for name in chosen}
    settings = [
        {
            "name": name,
            "expert": found.reports[EXACT],
            "world": joint_version(found.reports[EXACT].worlds),
            "success": success_table(found),
            "evidence": evidence_table(found),
            "loads": load_table(found),
        }
        for name, found in reports.items()
    ]
    rounded = reports[STANDARD].reports.get(ROUNDED)
    return render(
        "lerobot_env_bimanual.reports",
        "tasks.md",
        folder=folder.as_posix(),
        voxels=rounded.discretise if rounded else NOT_MEASURED,
        settings=settings,
        paper=paper_table(reports[STANDARD]),
    )
