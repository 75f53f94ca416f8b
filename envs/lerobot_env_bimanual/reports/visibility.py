"""What the cameras see, as it lies in a file, and as a section of a page with its tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import read_json
from lerobot_bimanual.json_record import decode
from lerobot_bimanual.markdown_table import MarkdownTable, markdown_table
from lerobot_env_bimanual.pictures.visibility import IMAGE_SIZE, MIN_PIXELS, NEAR_M, Moment, TargetViews
from lerobot_env_bimanual.tasks.registry import get_task

SECTION = """\

## What the cameras see

Written by `scripts/visibility.py` from {split} seeds {seeds}. The *target* of an arm is the part of an object, within
{near_cm:.0f} cm, that its fingers are next to at the end of a move; it counts as seen in a view before that move if at least
{pixels} of {size} x {size} pixels show it. What a hand carries is its target only if the hand brings it to nothing else.

{targets}

Pixels of the objects in each view, medians: at the start / over the start and all keyposes but the last.

{objects}
"""


@dataclass(frozen=True)
class Visibility:
    """What `scripts/visibility.py` writes.

    Attributes:
        split: of the seeds.
        seeds: of the episodes, "first:stop".
        worlds: version of each task's world.
        tasks: what the cameras see at each moment of each task.
    """

    split: str
    seeds: str
    worlds: dict[str, str]
    tasks: dict[str, tuple[Moment, ...]]

    @classmethod
    def read(cls, path: Path) -> Visibility:
        """Read a file.

        Raises:
            BimanualError: it is none that the script has written.
        """
        stored = decode(cls, read_json(path), str(path))
        if stored.worlds.keys() != stored.tasks.keys():
            raise BimanualError(f"{path}: worlds and tasks must name the same tasks")
        for task, moments in stored.tasks.items():
            if any(
                len(pixels) != len(CAMERA_NAMES) for moment in moments for pixels in moment.items.values()
            ):
                raise BimanualError(f"{path}: tasks.{task} must hold {len(CAMERA_NAMES)} pixels per object")
        return stored

    @property
    def task_names(self) -> list[str]:
        """In the paper's order."""
        return sorted(self.tasks, key=lambda name: get_task(name).spec.id)


def visibility_section(visibility: Visibility) -> str:
    """What was measured, with a heading, for the end of a page."""
    return SECTION.format(
        split=visibility.split,
        seeds=visibility.seeds,
        near_cm=100 * NEAR_M,
        pixels=MIN_PIXELS,
        size=IMAGE_SIZE,
        targets=targets_table(visibility),
        objects=pixels_table(visibility),
    )


def targets_table(visibility: Visibility) -> MarkdownTable:
    """Per task in how many views the arms' targets are seen, and which target is seen least."""
    headings = ("task", "targets", "seen in two views", "fewest views", "of", "before")
    rows = []
    for task in visibility.task_names:
        targets = list(_targets(visibility.tasks[task]))
        moment, arm, hardest = min(targets, key=lambda target: (target[2].least_views, target[2].seen))
        episodes = sum(views.episodes for *_, views in targets)
        rows.append(
            (
                f"`{task}`",
                episodes,
                f"{sum(views.seen for *_, views in targets) / episodes:.1%}",
                hardest.least_views,
                ", ".join(hardest.names),
                f"{moment.step + 1}. {moment.move} ({arm})",
            )
        )
    return MarkdownTable(headings, rows)


def pixels_table(visibility: Visibility) -> str:
    """Per object its pixels in each view, medians at the start and over all keyposes."""
    headings = ("task", "object", *(name.replace("_", " ") for name in CAMERA_NAMES))
    rows = []
    for task in visibility.task_names:
        moments = visibility.tasks[task]
        for name in moments[0].items:
            pixels = np.array([moment.items[name] for moment in moments])
            cells = zip(pixels[0], np.median(pixels, axis=0).astype(int), strict=True)
            rows.append((f"`{task}`", name, *(f"{start} / {later}" for start, later in cells)))
    return markdown_table(headings, rows)


def _targets(moments: tuple[Moment, ...]) -> Iterator[tuple[Moment, str, TargetViews]]:
    for moment in moments:
        for arm, views in moment.targets.items():
            yield moment, arm, views
