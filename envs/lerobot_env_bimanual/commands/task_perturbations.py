"""The command `task perturbations`."""

from __future__ import annotations

import shutil
import textwrap
from dataclasses import dataclass
from typing import Literal

WIDTH = 110
"""Columns where no terminal says how many there are."""


@dataclass
class TaskPerturbationsConfig:
    """Flags of `task perturbations`."""

    # Kind of the axes.
    group: Literal["all", "seen", "clutter", "bodies", "arms", "words", "time"] = "all"


def task_perturbations(config: TaskPerturbationsConfig) -> None:
    """List the axes of perturbation: levels, units, and where the numbers come from.

    `--env.perturb=AXIS:LEVEL,...` of lerobot-eval, and `--perturb` of the commands, take them by name.

    Examples:
        lerobot-bimanual task perturbations --group=seen
    """
    from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes

    axes = [axis for name in list_axes() if config.group in ("all", (axis := get_axis(name)).group)]
    width = shutil.get_terminal_size((WIDTH, 24)).columns
    for axis in axes:
        print(f"{axis.name}  ({axis.group})")
        levels = ", ".join(f"{level:g}" for level in axis.levels)
        for text in (axis.summary, f"levels 1 to 3: {levels} {axis.unit}", f"source: {axis.source}"):
            print(textwrap.fill(text, width, initial_indent="    ", subsequent_indent="      "))
