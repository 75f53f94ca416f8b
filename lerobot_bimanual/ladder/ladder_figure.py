"""The picture of one ladder: success against level, one small chart per axis."""

from collections.abc import Sequence
from itertools import pairwise

from lerobot_bimanual.canvas import BLUE, GREY, INK, PALE, VERMILION, WIDTH, Canvas, Color, Mark
from lerobot_bimanual.ladder.falls import Fall, falls
from lerobot_bimanual.ladder.result import AxisRecord, LadderResult, Rung
from lerobot_bimanual.perturbation_levels import MAX_LEVEL

SURE = 0.05
"""Corrected p-values up to this one are marked."""
MARGIN, TOP = 16, 112
COLUMNS, CHART_HEIGHT, AXIS_ROOM, GAP = 4, 190, 34, 14
CHART_WIDTH = (WIDTH - 2 * MARGIN) / COLUMNS
TALL = 110
BAND: Color = (205, 226, 240)
LEGEND: tuple[tuple[Mark, Color, str], ...] = (
    ("circle", BLUE, "policy, with its 95 % Wilson interval"),
    ("triangle", INK, "expert"),
    ("cross", GREY, "blind: mean keyposes, whatever the scene"),
)
REDDENED = f"Orange diamond: differs from level 0 on the same episodes, McNemar's exact test with p (Holm over axes) up to {SURE}."
HATCHED = "Hatched: not certified, since the expert solves too few; counted nowhere."


def ladder_figure(result: LadderResult) -> Canvas:
    """One chart per axis, by group and name: policy, expert and blind control against level, level 0 the same in all."""
    found = falls(result)
    rows = -(-len(result.axes) // COLUMNS) if result.axes else 1
    canvas = Canvas(TOP + rows * (CHART_HEIGHT + GAP) + MARGIN, _description(result, found))
    count = len(result.level_0.episodes)
    title = f"{result.policy} on {result.task}, the same {count} episodes at every level"
    canvas.text(MARGIN, 24, title, size=20, room=WIDTH - 2 * MARGIN)
    left = MARGIN
    for kind, color, text in LEGEND:
        canvas.mark(kind, left + 6, 50, color, 4)
        canvas.text(left + 16, 50, text, GREY, 12)
        left += 16 + canvas.text_width(text, 12) + 18
    for number, text in enumerate((REDDENED, HATCHED)):
        canvas.text(MARGIN, 70 + 18 * number, text, GREY, 12)
    for number, axis in enumerate(sorted(result.axes, key=lambda axis: (axis.group, axis.name))):
        row, column = divmod(number, COLUMNS)
        _draw_chart(
            canvas, MARGIN + CHART_WIDTH * column, TOP + row * (CHART_HEIGHT + GAP), axis, result, found
        )
    return canvas


def _description(result: LadderResult, found: dict[str, Fall]) -> str:
    said = [f"{result.policy} on {result.task}: level 0 {_counts(result.level_0)}."]
    for rung in result.rungs[1:]:
        p_holm = found[rung.name].p_holm
        remark = "not certified" if p_holm is None else f"p (Holm) {p_holm:.3g}"
        said.append(f"{rung.name} {_counts(rung)}, {remark}.")
    return " ".join(said)


def _counts(rung: Rung) -> str:
    rates = rung.rates
    others = ", ".join(f"{who} {rates[who].successes}" for who in ("expert", "blind"))
    return f"{rates['policy'].successes} of {rates['policy'].trials} ({others})"


def _draw_chart(
    canvas: Canvas, left: float, top: float, axis: AxisRecord, result: LadderResult, found: dict[str, Fall]
) -> None:
    rungs = [result.level_0, *result.of_axis(axis.name)]
    start, ceiling = left + AXIS_ROOM, top + 44
    step = (CHART_WIDTH - AXIS_ROOM - GAP) / (MAX_LEVEL + 1)

    def at(rung: Rung, share: float) -> tuple[float, float]:
        return start + step * (rung.level + 0.5), ceiling + TALL * (1 - share)

    canvas.text(left + CHART_WIDTH - GAP, top + 12, axis.group, GREY, 11, "rm")
    room = CHART_WIDTH - GAP - canvas.text_width(axis.group, 11) - 6
    canvas.text(left, top + 12, axis.name, size=14, room=room)
    magnitudes = ", ".join(f"{magnitude:g}" for magnitude in axis.magnitudes)
    canvas.text(left, top + 29, f"{magnitudes} {axis.unit}", GREY, 11, room=CHART_WIDTH - GAP)
    for rung in rungs:
        if not rung.is_certified:
            x, _ = at(rung, 0)
            canvas.hatching(x - step / 2, ceiling, x + step / 2, ceiling + TALL)
    intervals = [rung.rates["policy"].interval for rung in rungs]
    lower = [at(rung, low) for rung, (low, _) in zip(rungs, intervals, strict=True)]
    upper = [at(rung, high) for rung, (_, high) in zip(rungs, intervals, strict=True)]
    if len(rungs) > 1:
        canvas.area([*lower, *reversed(upper)], BAND)
    for percent in (0, 50, 100):
        y = ceiling + TALL * (1 - percent / 100)
        canvas.line((start, y), (left + CHART_WIDTH - GAP, y), PALE)
        canvas.text(start - 5, y, f"{percent}%", GREY, 11, "rm")
    for low, high in zip(lower, upper, strict=True):
        canvas.line(low, high, BLUE)
    for who, (kind, color, _) in zip(("blind", "expert", "policy"), reversed(LEGEND), strict=True):
        points = [at(rung, rung.rates[who].rate) for rung in rungs]
        _join(canvas, points, color, 2 if who == "policy" else 1)
        for rung, point in zip(rungs, points, strict=True):
            fall = found.get(rung.name)
            is_sure = who == "policy" and fall is not None and fall.p_holm is not None and fall.p_holm <= SURE
            if is_sure:
                canvas.mark("diamond", *point, VERMILION)
            else:
                canvas.mark(kind, *point, color, 4, hollow=not rung.is_certified)
    for level in range(MAX_LEVEL + 1):
        canvas.text(start + step * (level + 0.5), ceiling + TALL + 14, str(level), GREY, 11, "mm")


def _join(canvas: Canvas, points: Sequence[tuple[float, float]], color: Color, width: float) -> None:
    for one, other in pairwise(points):
        canvas.line(one, other, color, width)
