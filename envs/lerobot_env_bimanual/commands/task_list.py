"""The command `task list`."""

import json
import sys
from dataclasses import dataclass
from typing import Any, Literal

from lerobot_bimanual.terminal import print_table, show_next
from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks


@dataclass
class TaskListConfig:
    """Options of `task list`."""

    task: str = "all"  # task and suite names, comma separated
    format: Literal["list", "json"] = "list"  # for people or for programs


def task_list(config: TaskListConfig) -> None:
    """List the tasks with an instruction, the number of variations, control ticks at most, and suites.

    `--format=json` has all instructions, and what makes success, by variation.

    Examples:
        lerobot-bimanual task list
        lerobot-bimanual task list --task=synchronous --format=json
    """
    rows = [_row(name) for name in resolve_tasks(config.task)]
    if config.format == "json":
        json.dump(rows, sys.stdout, indent=2)
        sys.stdout.write("\n")
        return
    import pandas as pd

    table = pd.DataFrame(
        {
            "task": row["name"],
            "instruction": row["instructions"][0][0],
            "variations": len(row["variations"]),
            "ticks": row["horizon_ticks"],
            "suites": ", ".join(row["suites"]),
        }
        for row in sorted(rows, key=lambda row: row["id"])
    )
    print_table(table)
    show_next("lerobot-bimanual", "task", "view", f"--task={rows[0]['name']}")


def _row(name: str) -> dict[str, Any]:
    task = get_task(name)
    spec = task.spec
    return {
        "name": spec.name,
        "id": spec.id,
        "variations": [dict(variation.words) for variation in spec.variations],
        "instructions": [list(spec.instructions_for(variation)) for variation in spec.variations],
        "suites": list(spec.suites),
        "success": [
            [condition.name for condition in task.conditions(variation)] for variation in spec.variations
        ],
        "horizon_ticks": spec.horizon_ticks,
    }
