"""The picture of who lost episodes at which keypose: stacked bars, one panel per task."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from PIL import Image, ImageDraw, ImageFont

from lerobot_env_bimanual.audit.blame import Blame, Loser
from lerobot_env_bimanual.pictures.layout import GAP, GREY, INK, PAPER, TEXT_SIZE, TITLE_SIZE

COLORS = {
    Loser.LEFT: (0, 114, 178),
    Loser.RIGHT: (213, 94, 0),
    Loser.EITHER: (0, 158, 115),
    Loser.COORDINATION: (204, 121, 167),
    Loser.NOBODY: (150, 153, 160),
}
"""From the bottom of a bar; Okabe and Ito's, which the colour-blind can tell apart."""
WIDTH, PANEL_HEIGHT = 1200, 300
BAR_ROOM, TALLEST_BAR = 44, 190
LEFT_EDGE = 70


def blame_bars(found: Mapping[str, Sequence[Blame]]) -> Image.Image:
    """One panel per task.

    Args:
        found: what was found of the failed episodes of each task.
    """
    header = 2 * GAP + TITLE_SIZE + 2 * TEXT_SIZE
    sheet = Image.new("RGB", (WIDTH, header + PANEL_HEIGHT * len(found) + GAP), PAPER)
    draw = ImageDraw.Draw(sheet)
    draw.text(
        (GAP, GAP),
        "Index of the keypose that lost the episode, and who lost it",
        INK,
        ImageFont.load_default(TITLE_SIZE),
    )
    _draw_legend(draw, GAP + TITLE_SIZE + GAP)
    for row, (task, blames) in enumerate(found.items()):
        _draw_panel(draw, header + PANEL_HEIGHT * row, task, blames)
    return sheet


def _draw_legend(draw: ImageDraw.ImageDraw, top: int) -> None:
    font, left = ImageFont.load_default(TEXT_SIZE), GAP
    for loser, color in COLORS.items():
        draw.rectangle((left, top, left + TEXT_SIZE, top + TEXT_SIZE), fill=color)
        draw.text((left + TEXT_SIZE + 8, top - 2), loser, INK, font)
        left += TEXT_SIZE + 8 + round(draw.textlength(loser, font)) + 2 * GAP


def _draw_panel(draw: ImageDraw.ImageDraw, top: int, task: str, blames: Sequence[Blame]) -> None:
    font = ImageFont.load_default(TEXT_SIZE)
    counts = Counter((blame.last_recoverable, blame.loser) for blame in blames)
    lost = {index: total for index in range(_bars(blames)) if (total := _total(counts, index))}
    apart = len(blames) - sum(lost.values())
    note = f", {apart} of which nobody can tell" if apart else ""
    draw.text((GAP, top), f"{task}: {len(blames)} failed{note}", INK, font)
    floor, most = top + PANEL_HEIGHT - 2 * TEXT_SIZE, max(lost.values(), default=1)
    draw.text((LEFT_EDGE - 12, floor - TALLEST_BAR), str(most), GREY, font, anchor="rm")
    draw.text((LEFT_EDGE - 12, floor), "0", GREY, font, anchor="rm")
    draw.line((LEFT_EDGE, floor, WIDTH - GAP, floor), fill=GREY)
    room = min(BAR_ROOM, (WIDTH - GAP - LEFT_EDGE) // max(1, _bars(blames)))
    for index in range(_bars(blames)):
        left, height = LEFT_EDGE + room * index, 0
        draw.text((left + room // 2, floor + TEXT_SIZE), str(index), GREY, font, anchor="mm")
        for loser, color in COLORS.items():
            grown = height + counts[index, loser]
            if grown > height:
                ends = [floor - round(TALLEST_BAR * number / most) for number in (grown, height)]
                draw.rectangle((left + 4, ends[0], left + room - 4, ends[1] - 1), fill=color)
            height = grown


def _bars(blames: Sequence[Blame]) -> int:
    return 1 + max(
        (blame.last_recoverable for blame in blames if blame.last_recoverable is not None), default=0
    )


def _total(counts: Counter[tuple[int | None, Loser]], index: int) -> int:
    return sum(counts[index, loser] for loser in COLORS)
