"""The verb `tasks`: what there is to do."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass
from typing import Any, Literal

from lerobot_env_bimanual.tasks.registry import get_task, resolve_tasks


@dataclass
class TasksConfig:
    """Options of the verb `tasks`."""

    task: str = "all"  # task and suite names, comma separated
    format: Literal["table", "json"] = "table"  # for people or for programs


def tasks(config: TasksConfig) -> None:
    """List the tasks with their instructions, variations and taxonomy.

    Examples:
        lerobot-bimanual tasks
        lerobot-bimanual tasks --task=synchronous --format=json
    """
    rows = [_row(name) for name in resolve_tasks(config.task)]
    if config.format == "json":
        json.dump(rows, sys.stdout, indent=2)
        sys.stdout.write("\n")
    else:
        _print_table(rows)


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


def _print_table(rows: list[dict[str, Any]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("task", "variations", "instructions", "taxonomy", "horizon")
    for row in sorted(rows, key=lambda row: row["id"]):
        table.add_row(
            row["name"],
            str(len(row["variations"])),
            "\n".join(row["instructions"][0]),
            ", ".join(row["suites"]),
            f"{row['horizon_ticks']} ticks",
            end_section=True,
        )
    Console().print(table)
