"""Pages about tasks: one of all, with what was measured, and one per task, with what the registry says of it."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path

import pandas as pd

from lerobot_bimanual.pages import render
from lerobot_env_bimanual.conditions import with_parts
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
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.tasks.registry import get_task, gym_id
from lerobot_env_bimanual.world.servo_commands import TICK_S

PACKAGE = "lerobot_env_bimanual.reports"


def tasks_page(reports: ExpertReports, folder: Path) -> str:
    """The page of all tasks.

    Args:
        reports: the expert reports.
        folder: their folder, as the page names it.
    """
    expert, rounded = reports.reports[EXACT], reports.reports.get(ROUNDED)
    return render(
        PACKAGE,
        "tasks.md",
        folder=folder.as_posix(),
        world=joint_version(expert.worlds),
        expert=expert,
        voxels=rounded.discretise if rounded else NOT_MEASURED,
        **_tables(reports),
    )


def task_pages(reports: ExpertReports, pictures: dict[str, str], policies: dict[str, str]) -> dict[str, str]:
    """One page per task, by its name.

    Args:
        reports: the expert reports.
        pictures: Markdown of the video and pictures of each task.
        policies: Markdown about the policies that were scored on each task.
    """
    tables = _tables(reports)
    return {task: _page(task, pictures[task], policies[task], tables) for task in reports.tasks}


def _tables(reports: ExpertReports) -> dict[str, pd.DataFrame]:
    return {
        "success": success_table(reports),
        "evidence": evidence_table(reports),
        "loads": load_table(reports),
        "paper": paper_table(reports),
    }


def _page(task: str, pictures: str, policies: str, tables: dict[str, pd.DataFrame]) -> str:
    definition = get_task(task)
    spec = definition.spec
    module = importlib.import_module(type(definition).__module__)
    summary, _, about = (inspect.getdoc(module) or "").partition("\n\n")
    sentences = [
        {"variation": each.index, "sentence": sentence}
        for each in spec.variations
        for sentence in spec.instructions_for(each)
    ]
    conditions = [
        {"condition": f"`{each.name}`", "holds if": (inspect.getdoc(type(each)) or "").partition("\n")[0]}
        for each in dict.fromkeys(with_parts(definition.conditions(spec.variations[0])))
    ]
    return render(
        PACKAGE,
        "task.md",
        task=spec,
        row=f"`{task}`",
        summary=summary,
        about=about,
        pictures=pictures,
        policies=policies,
        facts=_facts(spec),
        instructions=pd.DataFrame(sentences),
        conditions=pd.DataFrame(conditions),
        **tables,
    )


def _facts(spec: TaskSpec) -> pd.DataFrame:
    facts = {
        "Gymnasium": f"`{gym_id(spec.name)}`",
        "LeRobot": f"`--env.type=bimanual --env.task={spec.name}`",
        "suites": ", ".join(f"`{suite}`" for suite in ("all", *spec.taxonomy.suites)),
        "variations": len(spec.variations),
        "ends after": f"{spec.horizon_ticks} ticks, {spec.horizon_ticks * TICK_S:g} s",
        "one arm alone": "cannot do it, the paper says" if spec.needs_both_arms else "may do it",
    }
    return pd.DataFrame({"fact": [*facts], "value": [*facts.values()]})
