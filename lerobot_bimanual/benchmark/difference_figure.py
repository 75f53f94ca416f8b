"""The picture of two policies: by how much one is better on each task, and how sure that is."""

from collections.abc import Mapping
from math import ceil

from lerobot_bimanual.benchmark.pairing import Comparison
from lerobot_bimanual.canvas import BLUE, GREY, INK, ORANGE, PALE, WIDTH, Canvas
from lerobot_bimanual.results.statistics import holm

LEVEL = 0.05
"""Corrected p-values up to this one are marked."""
LEFT, RIGHT = 200, WIDTH - 230
"""Where the axis begins and ends."""
COLUMNS = (RIGHT + 72, RIGHT + 138, WIDTH - 16)
"""Right edges of the columns beside it."""
TOP, LINE, MARGIN = 150, 38, 16
CAPTION = (
    "Blue: one standard error, for which episodes were drawn. Orange, below it: one standard error, for which trainings",
    f"there were; it takes two of each policy. Filled: p (Holm) up to {LEVEL}. In brackets the number of shared episodes.",
)


def difference_figure(comparisons: Mapping[str, Comparison]) -> Canvas:
    """One line per task, by name: the difference with its errors, on how many episodes either is better, and p-values."""
    corrected = holm([comparison.p_value for comparison in comparisons.values()])
    one = next(iter(comparisons.values()))
    subject = f"first ({one.first[0].policy}) less second ({one.second[0].policy})"
    said = (
        f"{place}: {comparison.difference:+.1%}, p (Holm) {p_holm:.3g}."
        for (place, comparison), p_holm in zip(comparisons.items(), corrected, strict=True)
    )
    height = TOP + LINE * len(comparisons) + 3 * MARGIN
    canvas = Canvas(height, f"Success, {subject}. {' '.join(said)}")
    canvas.text(MARGIN, 24, f"Success on the same episodes: {subject}", size=20, room=WIDTH - 2 * MARGIN)
    tests = " or ".join(sorted({comparison.test for comparison in comparisons.values()}))
    for number, text in enumerate((*CAPTION, f"p is that of {tests}.")):
        canvas.text(MARGIN, 48 + 18 * number, text, GREY, 12)
    reach = _reach(comparisons)
    _draw_axis(canvas, height - 2 * MARGIN, reach)
    for x, heading in zip(COLUMNS, ("better on", "p", "p (Holm)"), strict=True):
        canvas.text(x, TOP - 24, heading, GREY, 12, "rm")
    for number, (place, comparison) in enumerate(comparisons.items()):
        _draw_line(canvas, TOP + LINE * (number + 0.5), reach, place, comparison, corrected[number])
    return canvas


def _reach(comparisons: Mapping[str, Comparison]) -> float:
    """Where the axis ends, in tenths: beyond every error."""
    ends = (
        abs(comparison.difference) + max(comparison.episode_error, comparison.training_error or 0)
        for comparison in comparisons.values()
    )
    return max(0.1, ceil(10 * max(ends)) / 10)


def _draw_axis(canvas: Canvas, bottom: float, reach: float) -> None:
    for share in (-reach, -reach / 2, 0, reach / 2, reach):
        x = _x(share, reach)
        canvas.line((x, TOP - 10), (x, bottom), GREY if share == 0 else PALE)
        canvas.text(x, bottom + 12, f"{share:+.0%}" if share else "0", GREY, 12, "mm")


def _draw_line(
    canvas: Canvas, y: float, reach: float, place: str, comparison: Comparison, p_holm: float
) -> None:
    label = f"{place} ({len(comparison.seeds)})"
    canvas.text(LEFT - MARGIN, y, label, anchor="rm", room=LEFT - 2 * MARGIN)
    x = _x(comparison.difference, reach)
    for error, color, below in (
        (comparison.episode_error, BLUE, 0),
        (comparison.training_error, ORANGE, 9),
    ):
        if error is not None:
            low, high = (_x(comparison.difference + sign * error, reach) for sign in (-1, 1))
            canvas.line((low, y + below), (high, y + below), color, 2.5)
    canvas.mark("circle", x, y, BLUE, hollow=p_holm > LEVEL)
    values = ("{}, {}".format(*comparison.better), f"{comparison.p_value:.2g}", f"{p_holm:.2g}")
    for right, value in zip(COLUMNS, values, strict=True):
        canvas.text(right, y, value, INK, anchor="rm")


def _x(share: float, reach: float) -> float:
    return LEFT + (share + reach) / (2 * reach) * (RIGHT - LEFT)
