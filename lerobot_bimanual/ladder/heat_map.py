"""The picture of several ladders: axis against policy, each field the success at its three levels."""

from collections.abc import Mapping, Sequence
from itertools import batched, groupby

from lerobot_bimanual.canvas import GREY, INK, PALE, PAPER, WIDTH, Canvas, Color
from lerobot_bimanual.ladder.result import AxisRecord, LadderResult, Rung, short_name
from lerobot_bimanual.perturbation_levels import MAX_LEVEL

MARGIN, TOP, LINE = 16, 82, 24
LEFT = 240
"""Where the fields begin; the axes' names stand before them."""
HEADING = 50
WIDEST, GAP = 132, 10
MOST_COLUMNS = 6
"""Side by side, so that numbers of three digits fit; more go below."""
FULL: Color = (0, 90, 150)
"""Of a rung where everything is solved; paper where nothing is."""
CAPTION = (
    "Percent of the same episodes solved, darker for more; in a field, levels 1, 2, 3 from left to right.",
    "Hatched: not certified, since the expert solves too few. Empty: not played, or nothing to change in the task.",
)


def heat_map(ladders: Mapping[str, LadderResult]) -> Canvas:
    """One line per axis, one column per ladder; the ladders of a task side by side.

    Args:
        ladders: by name.
    """
    axes = _axes([*ladders.values()])
    by_task = groupby(sorted(ladders.items(), key=_task), key=_task)
    blocks = [block for _, of_task in by_task for block in batched(of_task, MOST_COLUMNS)]
    height = TOP + len(blocks) * (HEADING + (len(axes) + 1) * LINE + 2 * MARGIN)
    canvas = Canvas(height, _description(ladders))
    canvas.text(MARGIN, 24, "Success, rung by rung", size=20)
    for number, text in enumerate(CAPTION):
        canvas.text(MARGIN, 46 + 18 * number, text, GREY, 12)
    top = TOP
    for block in blocks:
        _draw_block(canvas, top, block, axes)
        top += HEADING + (len(axes) + 1) * LINE + 2 * MARGIN
    return canvas


def _task(named: tuple[str, LadderResult]) -> str:
    return named[1].task


def _axes(ladders: Sequence[LadderResult]) -> list[AxisRecord]:
    """All axes of all ladders, by group and name."""
    found = {axis.name: axis for ladder in ladders for axis in ladder.axes}
    return sorted(found.values(), key=lambda axis: (axis.group, axis.name))


def _description(ladders: Mapping[str, LadderResult]) -> str:
    said = []
    for name, ladder in ladders.items():
        rungs = ", ".join(f"{rung.name} {_percent(rung)}" for rung in ladder.rungs if rung.is_certified)
        said.append(f"{name}, {ladder.policy} on {ladder.task}: {rungs}.")
    return " ".join(said)


def _draw_block(
    canvas: Canvas, top: float, ladders: Sequence[tuple[str, LadderResult]], axes: Sequence[AxisRecord]
) -> None:
    width = min(WIDEST, (WIDTH - LEFT - MARGIN) / len(ladders))
    first = top + HEADING
    canvas.text(MARGIN, first + LINE / 2, "level 0")
    group = ""
    for number, axis in enumerate(axes, start=1):
        y = first + LINE * (number + 0.5)
        if axis.group != group:
            group = axis.group
            canvas.line((MARGIN, y - LINE / 2), (LEFT - MARGIN, y - LINE / 2), PALE)
            canvas.text(LEFT - MARGIN, y, group, GREY, 11, "rm")
        canvas.text(MARGIN, y, axis.name, room=LEFT - 4.5 * MARGIN)
    for number, (name, ladder) in enumerate(ladders):
        left = LEFT + width * number
        right = left + width - GAP
        heading = (short_name(name, ladder), ladder.task, f"{ladder.policy} {ladder.checkpoint_sha256[:8]}")
        for line, text in enumerate(heading):
            canvas.text(left, top + 8 + 14 * line, text, INK if line == 0 else GREY, 11, room=right - left)
        _draw_field(canvas, left, first, right, ladder.level_0)
        for line, axis in enumerate(axes, start=1):
            part = (right - left) / MAX_LEVEL
            for rung in ladder.of_axis(axis.name):
                start = left + part * (rung.level - 1)
                _draw_field(canvas, start, first + LINE * line, start + part, rung)


def _draw_field(canvas: Canvas, left: float, top: float, right: float, rung: Rung) -> None:
    bottom = top + LINE - 2
    middle, text = ((left + right) / 2, (top + bottom) / 2), _percent(rung).removesuffix("%")
    if not rung.is_certified:
        canvas.rectangle(left, top, right, bottom, PAPER, PALE)
        canvas.hatching(left, top, right, bottom)
        canvas.text(*middle, text, GREY, 11, "mm", right - left)
        return
    share = rung.rates["policy"].rate
    red, green, blue = (
        round(paper + share * (full - paper)) for paper, full in zip(PAPER, FULL, strict=True)
    )
    canvas.rectangle(left, top, right, bottom, (red, green, blue), PALE)
    canvas.text(*middle, text, PAPER if share > 0.55 else INK, 11, "mm", right - left)


def _percent(rung: Rung) -> str:
    return f"{rung.rates['policy'].rate:.0%}"
