"""The picture of who lost episodes at which keypose: stacked bars, one panel per task, or group of its episodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from lerobot_bimanual.canvas import BLUE, GREY, INK, ORANGE, PALE, PAPER, WIDTH, YELLOW, Canvas
from lerobot_env_bimanual.audit.blame import Blame, Loser

STYLES = {
    Loser.LEFT: ("L", BLUE, PAPER),
    Loser.RIGHT: ("R", ORANGE, INK),
    Loser.EITHER: ("E", INK, PAPER),
    Loser.COORDINATION: ("C", YELLOW, INK),
    Loser.NOBODY: ("N", PAPER, INK),
}
"""Letter, colour and the colour of letters on it, from the bottom of a bar; greys of five steps without colours."""
MARGIN, TOP = 16, 92
COLUMNS, PANEL_HEIGHT = 3, 178
PANEL_WIDTH = (WIDTH - 2 * MARGIN) / COLUMNS
TALLEST_BAR, WIDEST_BAR, AXIS_ROOM, GAP = 96, 40, 28, 24
LETTER = 11
"""Height and width that a letter in a bar takes."""


def blame_bars(found: Mapping[str, Sequence[Blame]]) -> Canvas:
    """One panel per task with failed episodes.

    Args:
        found: what was found of the failed episodes of each task; where one is played in several ways, of each of these.
    """
    shown = {task: blames for task, blames in found.items() if blames}
    rows = -(-len(shown) // COLUMNS)
    said = [_sentence(task, blames) for task, blames in found.items()]
    canvas = Canvas(TOP + PANEL_HEIGHT * rows + 2 * MARGIN, " ".join(said))
    canvas.text(MARGIN, 24, "At which keypose failed episodes were lost, and by whom", size=20)
    canvas.text(
        MARGIN,
        48,
        "Across: index of the last keypose before which the expert could still save them.",
        GREY,
        12,
    )
    _draw_legend(canvas, 72)
    for number, (task, blames) in enumerate(shown.items()):
        row, column = divmod(number, COLUMNS)
        _draw_panel(canvas, MARGIN + PANEL_WIDTH * column, TOP + PANEL_HEIGHT * row, task, blames)
    if without := [task for task in found if task not in shown]:
        text = f"No failed episode: {', '.join(without)}"
        canvas.text(MARGIN, TOP + PANEL_HEIGHT * rows + MARGIN, text, GREY, 12, room=WIDTH - 2 * MARGIN)
    return canvas


def _sentence(task: str, blames: Sequence[Blame]) -> str:
    counts = Counter(blame.loser for blame in blames)
    parts = [f", {count} by {loser}" for loser, count in sorted(counts.items())]
    return f"{task}: {len(blames)} failed{''.join(parts)}."


def _draw_legend(canvas: Canvas, y: float) -> None:
    left = MARGIN
    for loser, (letter, color, ink) in STYLES.items():
        canvas.rectangle(left, y - 8, left + 16, y + 8, color, INK)
        canvas.text(left + 8, y, letter, ink, LETTER, "mm")
        canvas.text(left + 22, y, loser)
        left += 22 + canvas.text_width(loser) + GAP


def _draw_panel(canvas: Canvas, left: float, top: float, task: str, blames: Sequence[Blame]) -> None:
    counts = Counter((blame.last_recoverable, blame.loser) for blame in blames)
    lost = {index: sum(counts[index, loser] for loser in STYLES) for index in range(_bars(blames))}
    canvas.text(left, top + 14, f"{task}, {len(blames)} failed", room=PANEL_WIDTH - GAP)
    if apart := len(blames) - sum(lost.values()):
        canvas.text(left, top + 31, f"{apart} of which nobody can tell", GREY, 12)
    floor, most = top + 44 + TALLEST_BAR, max(1, *lost.values())
    for number in (0, most):
        y = floor - TALLEST_BAR * number / most
        canvas.line((left + AXIS_ROOM, y), (left + PANEL_WIDTH - GAP, y), PALE)
        canvas.text(left + AXIS_ROOM - 6, y, str(number), GREY, 12, "rm")
    room = min(WIDEST_BAR, (PANEL_WIDTH - GAP - AXIS_ROOM) / len(lost))
    every = max(1, round(18 / room))
    for index in lost:
        start = left + AXIS_ROOM + room * index
        if index % every == 0:
            canvas.text(start + room / 2, floor + 12, str(index), GREY, 12, "mm")
        base = floor
        for loser, (letter, color, ink) in STYLES.items():
            height = TALLEST_BAR * counts[index, loser] / most
            if height:
                canvas.rectangle(start + 2, base - height, start + room - 2, base, color, INK)
            if height > LETTER and room > LETTER + 4:
                canvas.text(start + room / 2, base - height / 2, letter, ink, LETTER, "mm")
            base -= height


def _bars(blames: Sequence[Blame]) -> int:
    return 1 + max(
        (blame.last_recoverable for blame in blames if blame.last_recoverable is not None), default=0
    )
