"""The command `task list`."""

from __future__ import annotations

import json
import shutil
import sys
import textwrap
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal

from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks

WIDTH = 110
"""Columns where no terminal says how many there are."""


@dataclass
class TaskListConfig:
    """Options of `task list`."""

    task: str = "all"  # task and suite names, comma separated
    format: Literal["list", "json"] = "list"  # for people or for programs


def task_list(config: TaskListConfig) -> None:
    """List the tasks with their instructions, variations and taxonomy.

    The instructions shown are those of the first variation; `--format=json` has all of them, and what makes success.

    Examples:
        lerobot-bimanual task list
        lerobot-bimanual task list --task=synchronous --format=json
    """
    rows = [_row(name) for name in resolve_tasks(config.task)]
    if config.format == "json":
        json.dump(rows, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return
    for row in sorted(rows, key=lambda row: row["id"]):
        count = len(row["variations"])
        title = f"{row['name']}  ({count} variation{'s' * (count > 1)}, at most {row['horizon_ticks']} ticks)"
        _print_paragraph(title, (*row["instructions"][0], ", ".join(row["suites"])))
    show_next("lerobot-bimanual", "task", "view", f"--task={rows[0]['name']}")


def _row(name: str) -> dict[str, Any]:
    spec = get_task(name).spec
    return {
        "name": spec.name,
        "id": spec.id,
        "variations": [dict(variation.words) for variation in spec.variations],
        "instructions": [list(spec.instructions_for(variation)) for variation in spec.variations],
        "taxonomy": asdict(spec.taxonomy),
        "suites": list(spec.taxonomy.suites),
        "success": [condition.name for condition in spec.success],
        "horizon_ticks": spec.horizon_ticks,
    }


def _print_paragraph(title: str, texts: Iterable[str]) -> None:
    """Indented texts under a title, as wide as the terminal; a table would cut names."""
    width = shutil.get_terminal_size((WIDTH, 24)).columns
    print(title)
    for text in texts:
        print(textwrap.fill(text, width, initial_indent="    ", subsequent_indent="      "))
