"""One page of documentation per task: what it is, from the registry, and what was measured of it."""

from __future__ import annotations

import importlib
import inspect
from functools import cached_property

import pandas as pd

from lerobot_bimanual.pages import render
from lerobot_env_bimanual.reports.expert_tables import (
    ExpertReports,
    evidence_table,
    load_table,
    paper_table,
    success_table,
)
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.tasks.registry import get_task, gym_id
from lerobot_env_bimanual.world.servo_commands import TICK_S


class TaskPages:
    """The pages of all certified tasks.

    Args:
        reports: reports of the experts and baselines.
    """

    def __init__(self, reports: ExpertReports):
        self.tasks = reports.tasks
        self._reports = reports

    def page(self, task: str, pictures: str, policies: str) -> str:
        """The page of one task.

        Args:
            task: its name.
            pictures: Markdown of its video and pictures.
            policies: Markdown about the policies that were scored on it.
        """
        spec = get_task(task).spec
        module = importlib.import_module(type(get_task(task)).__module__)
        summary, _, about = (inspect.getdoc(module) or "").partition("\n\n")
        sentences = [(each.index, "; ".join(spec.instructions_for(each))) for each in spec.variations]
        return render(
            "lerobot_env_bimanual.reports",
            "task.md",
            task=spec,
            row=f"`{task}`",
            summary=summary,
            about=about,
            pictures=pictures,
            policies=policies,
            facts=_facts(spec),
            instructions=pd.DataFrame(sentences, columns=["variation", "sentences"]),
            success=_success(task),
            **self._tables,
        )

    @cached_property
    def _tables(self) -> dict[str, pd.DataFrame]:
        return {
            "rates": success_table(self._reports),
            "evidence": evidence_table(self._reports),
            "loads": load_table(self._reports),
            "paper": paper_table(self._reports),
        }


def _facts(spec: TaskSpec) -> pd.DataFrame:
    facts = {
        "Gymnasium": f"`{gym_id(spec.name)}`",
        "LeRobot": f"`--env.type=bimanual --env.task={spec.name}`",
        "suites": ", ".join(f"`{suite}`" for suite in ("all", *spec.taxonomy.suites)),
        "variations": len(spec.variations),
        "ends after": f"{spec.horizon_ticks} ticks, {spec.horizon_ticks * TICK_S:g} s",
        "one arm alone": "cannot do it, the paper says" if spec.needs_both_arms else "may do it",
    }
    return pd.DataFrame([*facts.items()], columns=["fact", "value"])


def _success(task: str) -> pd.DataFrame:
    """Each condition's name, and what its class says of itself."""
    conditions = get_task(task).conditions(get_task(task).spec.variations[0])
    rows = [(f"`{each.name}`", (inspect.getdoc(type(each)) or "").partition("\n")[0]) for each in conditions]
    return pd.DataFrame(rows, columns=["condition", "holds if"])
