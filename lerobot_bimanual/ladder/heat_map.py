"""The picture of several ladders: axis against policy, each field the success at its three levels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import batched, groupby
from statistics import fmean

from lerobot_bimanual.canvas import GREY, INK, PALE, PAPER, WIDTH, Canvas, Color
from lerobot_bimanual.ladder.result import LEVEL_0, AxisRecord, LadderResult, rung_name
from lerobot_bimanual.ladder.trainings import by_policy
from lerobot_bimanual.perturbation_levels import MAX_LEVEL

MARGIN, TOP, LINE = 16, 82, 24
LEFT = 196
"""Where the fields begin; the axes' names stand before them."""
HEADING = 36
WIDEST, GAP = 132, 6
MOST_COLUMNS = 6
"""Side by side, so that numbers of three digits and names of policies fit; more go below."""
FULL: Color = (0, 90, 150)
"""Of a rung where everything is solved; paper where nothing is."""
CAPTION = (
    "Percent of the same episodes solved, in the mean over trainings, darker for more; in a field, levels 1, 2, 3 from left to right.",
    "Hatched: not certified, since the expert solves too few. Empty: not played, or nothing to change in the task.",
)


@dataclass(frozen=True)
class Column:
    """A policy on the ladder of a task.

    Attributes:
        task: of the ladder.
        policy: name of the policy.
        trainings: its ladders.
    """

    task: str
    policy: str
    trainings: Sequence[LadderResult]

    def share(self, rung: str) -> float | None:
        """Of the episodes of a rung, what is solved in the mean over trainings; None if one has not played it."""
        played = [ladder.by_name.get(rung) for ladder in self.trainings]
        rates = [each.rates["policy"].rate for each in played if each is not None]
        return fmean(rates) if len(rates) == len(self.trainings) else None

    def is_certified(self, rung: str) -> bool:
        """Whether it is in all of them."""
        return all(ladder.by_name[rung].is_certified for ladder in self.trainings)

    @property
    def rungs(self) -> list[str]:
        """Names of those that all trainings have played, level 0 first."""
        return [rung.name for rung in self.trainings[0].rungs if self.share(rung.name) is not None]

    @property
    def origin(self) -> str:
        """The type of the policy and its weights, or how often it was trained."""
        first, *others = self.trainings
        return f"{len(others) + 1} trainings" if others else f"{first.policy} {first.checkpoint_sha256[:8]}"


def heat_map(ladders: Mapping[str, LadderResult]) -> Canvas:
    """One line per axis, one column per policy; the policies of a task side by side.

    Args:
        ladders: by name.
    """
    axes = _axes([*ladders.values()])
    columns = [Column(*key, trainings) for key, trainings in by_policy(ladders).items()]
    columns.sort(key=_task)
    blocks = [block for _, of_task in groupby(columns, key=_task) for block in batched(of_task, MOST_COLUMNS)]
    height = TOP + len(blocks) * (HEADING + (len(axes) + 1) * LINE + 2 * MARGIN)
    canvas = Canvas(height, " ".join(map(_description, columns)))
    canvas.text(MARGIN, 24, "Success, rung by rung", size=20)
    for number, text in enumerate(CAPTION):
        canvas.text(MARGIN, 46 + 18 * number, text, GREY, 12)
    top = TOP
    for block in blocks:
        _draw_block(canvas, top, block, axes)
        top += HEADING + (len(axes) + 1) * LINE + 2 * MARGIN
    return canvas


def _task(column: Column) -> str:
    return column.task


def _axes(ladders: Sequence[LadderResult]) -> list[AxisRecord]:
    """All axes of all ladders, by group and name."""
    found = {axis.name: axis for ladder in ladders for axis in ladder.axes}
    return sorted(found.values(), key=lambda axis: (axis.group, axis.name))


def _description(column: Column) -> str:
    rungs = ", ".join(
        f"{rung} {column.share(rung):.0%}" for rung in column.rungs if column.is_certified(rung)
    )
    return f"{column.policy}, {column.origin}, on {column.task}: {rungs}."


def _draw_block(canvas: Canvas, top: float, columns: Sequence[Column], axes: Sequence[AxisRecord]) -> None:
    width = min(WIDEST, (WIDTH - LEFT - MARGIN) / len(columns))
    first = top + HEADING
    canvas.text(MARGIN, top + 8, columns[0].task)
    canvas.text(MARGIN, first + LINE / 2, "level 0")
    group = ""
    for number, axis in enumerate(axes, start=1):
        y = first + LINE * (number + 0.5)
        if axis.group != group:
            group = axis.group
            canvas.line((MARGIN, y - LINE / 2), (LEFT - MARGIN, y - LINE / 2), PALE)
            canvas.text(LEFT - MARGIN, y, group, GREY, 11, "rm")
        canvas.text(MARGIN, y, axis.name, room=LEFT - 3.8 * MARGIN)
    for number, column in enumerate(columns):
        left = LEFT + width * number
        right = left + width - GAP
        for line, text in enumerate((column.policy, column.origin)):
            canvas.text(left, top + 8 + 14 * line, text, INK if line == 0 else GREY, 10, room=right - left)
        _draw_field(canvas, left, first, right, column, LEVEL_0)
        for line, axis in enumerate(axes, start=1):
            part = (right - left) / MAX_LEVEL
            for level in range(1, MAX_LEVEL + 1):
                start = left + part * (level - 1)
                _draw_field(
                    canvas, start, first + LINE * line, start + part, column, rung_name(axis.name, level)
                )


def _draw_field(canvas: Canvas, left: float, top: float, right: float, column: Column, rung: str) -> None:
    if (share := column.share(rung)) is None:
        return
    bottom = top + LINE - 2
    middle, text = ((left + right) / 2, (top + bottom) / 2), f"{100 * share:.0f}"
    if not column.is_certified(rung):
        canvas.rectangle(left, top, right, bottom, PAPER, PALE)
        canvas.hatching(left, top, right, bottom)
        canvas.text(*middle, text, GREY, 11, "mm", right - left)
        return
    red, green, blue = (
        round(paper + share * (full - paper)) for paper, full in zip(PAPER, FULL, strict=True)
    )
    canvas.rectangle(left, top, right, bottom, (red, green, blue), PALE)
    canvas.text(*middle, text, PAPER if share > 0.55 else INK, 11, "mm", right - left)
