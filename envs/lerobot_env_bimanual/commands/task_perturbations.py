"""The command `task perturbations`."""

from __future__ import annotations

import shutil
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from lerobot_bimanual.errors import BimanualError, InvalidChoice, check_range

if TYPE_CHECKING:
    from lerobot_env_bimanual.perturbations.axis import Axis

WIDTH = 110
"""Columns where no terminal says how many there are."""


@dataclass
class TaskPerturbationsConfig:
    """Flags of `task perturbations`."""

    # Kind of the axes.
    group: Literal["all", "seen", "clutter", "bodies", "arms", "words", "time"] = "all"
    # Contact sheet, .jpg or .png: what is seen of each axis at each level. By default the axes are listed.
    output: Path | None = None
    task: str = "push_box"  # task of the contact sheet
    first_seed: int = 0  # seed of the contact sheet's episode, in the split `val`
    workers: int = 0  # processes; 0 takes one per core


def task_perturbations(config: TaskPerturbationsConfig) -> None:
    """List the axes of perturbation: levels, units, and where the numbers come from.

    `--env.perturb=AXIS:LEVEL,...` of lerobot-eval, and `--perturb` of the commands, take them by name.

    Examples:
        lerobot-bimanual task perturbations --group=seen
        lerobot-bimanual task perturbations --group=seen --output=outputs/perturbations.jpg --task=push_box
    """
    from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes

    axes = [axis for name in list_axes() if config.group in ("all", (axis := get_axis(name)).group)]
    if config.output is not None:
        _draw(config, axes, config.output)
        return
    width = shutil.get_terminal_size((WIDTH, 24)).columns
    for axis in axes:
        print(f"{axis.name}  ({axis.group})")
        levels = ", ".join(f"{level:g}" for level in axis.levels)
        for text in (axis.summary, f"levels 1 to 3: {levels} {axis.unit}", f"source: {axis.source}"):
            print(textwrap.fill(text, width, initial_indent="    ", subsequent_indent="      "))


def _draw(config: TaskPerturbationsConfig, axes: list[Axis], picture: Path) -> None:
    """A row for each of these axes that changes images of the task."""
    from lerobot_bimanual.files import check_output_file
    from lerobot_env_bimanual.rendering.axes_sheet import Row, axes_sheet, draw_row
    from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
    from lerobot_env_bimanual.tasks.registry import get_task
    from lerobot_env_bimanual.workers import WorkerPool
    from lerobot_env_bimanual.world.arena import build_spec

    check_range("first_seed", config.first_seed, 0)
    if picture.suffix not in (".jpg", ".png"):
        raise InvalidChoice("output", str(picture), "a file that ends in .jpg or .png")
    check_output_file(picture)
    task = get_task(config.task).spec
    model = build_spec(task.props, PANDA_PAIR)
    rows = [Row(axis.name, task.name, config.first_seed) for axis in axes if axis.applies_to(task, model)]
    with WorkerPool(config.workers) as pool:
        panels = list(pool.map(draw_row, rows, "perturbations", "axis", name=lambda row: row.axis))
    if not any(panels):
        raise BimanualError(
            f"no axis of the group {config.group!r} changes what is seen of {task.name!r} at its start"
        )
    axes_sheet(rows[0], [panel for row in panels for panel in row]).save(picture, quality=85)
    print(f"{picture}: {', '.join(row.axis for row, drawn in zip(rows, panels, strict=True) if drawn)}")
