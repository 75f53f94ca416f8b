"""One page of documentation per task: what it is, from the registry, and what was measured of it, from certificates."""

from __future__ import annotations

import importlib
import inspect
from functools import cached_property

from lerobot_bimanual.markdown_table import MarkdownTable, markdown_table
from lerobot_env_bimanual.reports.certified import (
    Certified,
    evidence_table,
    paper_table,
    strain_table,
    success_table,
)
from lerobot_env_bimanual.reports.visibility import Visibility, targets_table
from lerobot_env_bimanual.task import TaskSpec
from lerobot_env_bimanual.tasks.registry import get_task, gym_id
from lerobot_env_bimanual.world.servo_commands import TICK_S

PAGE = """\
# {name}

{summary}

{pictures}
{facts}

## Instructions

Every episode draws a variation and one of its sentences.

{instructions}

## Success

An episode is solved when all of these have held for half a second.{variation}

{success}

## What it asks for, and where it departs from the paper's

{about}

## Policies

{policies}

## Certificate of the expert and its controls

What each line means stands in [the tasks, measured](../tasks.md).

{certificate}

One arm alone plays as cunningly as we know how: it knows the scene's state and may try its ways in a copy of the episode.

### What else was found out about the expert's episodes

{evidence}

### What is asked of the arms

{strain}

### Beside the paper

In brackets the paper's figures.

{paper}

### What the cameras see

{visibility}
"""


class TaskPages:
    """The pages of all certified tasks."""

    def __init__(self, certified: Certified, visibility: Visibility):
        """Keep what is measured.

        Args:
            certified: of the experts and controls.
            visibility: what the cameras see.
        """
        self.tasks = certified.tasks
        self._certified, self._visibility = certified, visibility

    def page(self, task: str, pictures: str, policies: str) -> str:
        """The page of one task.

        Args:
            task: its name.
            pictures: Markdown of its film and pictures.
            policies: Markdown about the policies that were scored on it.
        """
        spec, row = get_task(task).spec, f"`{task}`"
        summary, about = _about(task)
        tables = self._tables
        bounds = ("*at most*", f"*at most in {row}*")
        return PAGE.format(
            name=task,
            summary=summary,
            about=about,
            pictures=pictures,
            policies=policies,
            facts=_facts(spec),
            instructions=_instructions(spec),
            variation=" Those of the first variation:" if len(spec.variations) > 1 else "",
            success=_success(task),
            certificate=tables["success"].upright(row),
            evidence=tables["evidence"].upright(row),
            strain=tables["strain"].upright(row, *bounds),
            paper=tables["paper"].upright(row),
            visibility=tables["visibility"].upright(row),
        )

    @cached_property
    def _tables(self) -> dict[str, MarkdownTable]:
        return {
            "success": success_table(self._certified),
            "evidence": evidence_table(self._certified),
            "strain": strain_table(self._certified),
            "paper": paper_table(self._certified),
            "visibility": targets_table(self._visibility),
        }


def _about(task: str) -> tuple[str, str]:
    """The first sentence of the task's file, and the paragraphs that follow it."""
    module = importlib.import_module(type(get_task(task)).__module__)
    summary, _, about = (inspect.getdoc(module) or "").partition("\n\n")
    return summary, about


def _facts(spec: TaskSpec) -> str:
    facts = {
        "Gymnasium": f"`{gym_id(spec.name)}`",
        "LeRobot": f"`--env.type=bimanual --env.task={spec.name}`",
        "suites": ", ".join(f"`{suite}`" for suite in ("all", *spec.taxonomy.suites)),
        "variations": len(spec.variations),
        "ends after": f"{spec.horizon_ticks} ticks, {spec.horizon_ticks * TICK_S:g} s",
        "one arm alone": "cannot do it, the paper says" if spec.needs_both_arms else "may do it",
    }
    return markdown_table(("fact", "value"), list(facts.items()), of_words=True)


def _instructions(spec: TaskSpec) -> str:
    rows = [(variation.index, "; ".join(spec.instructions_for(variation))) for variation in spec.variations]
    return markdown_table(("variation", "sentences"), rows, of_words=True)


def _success(task: str) -> str:
    """Each condition's name, and what its class says of itself."""
    conditions = get_task(task).conditions(get_task(task).spec.variations[0])
    rows = [(f"`{each.name}`", (inspect.getdoc(type(each)) or "").partition("\n")[0]) for each in conditions]
    return markdown_table(("condition", "holds if"), rows, of_words=True)
