"""Lays labelled pictures out on a sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

PANEL_WIDTH = 400
CAPTION_HEIGHT = 34
GAP = 16
TITLE_SIZE, TEXT_SIZE, CAPTION_SIZE = 34, 21, 19

PAPER = (255, 255, 255)
INK = (32, 34, 40)
GREY = (112, 116, 126)
GREEN = (22, 128, 60)
RED = (196, 38, 34)


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture with a line of text below.

    Attributes:
        rgb: (height, width, 3) uint8; all panels of a sheet have the same shape.
        caption: text at the left end of the line.
        note: text at its right end.
        color: RGB of both texts; a colour other than `INK` also frames the picture.
    """

    rgb: NDArray[np.uint8]
    caption: str
    note: str = ""
    color: tuple[int, int, int] = INK


def contact_sheet(title: str, lines: Sequence[str], panels: Sequence[Panel], columns: int = 4) -> Image.Image:
    """Panels in rows under a title and lines of text."""
    grid = gallery(panels, columns)
    texts = [(title, TITLE_SIZE, INK), *((line, TEXT_SIZE, GREY) for line in lines)]
    header = GAP + sum(size + GAP // 2 for _, size, _ in texts)
    sheet = Image.new("RGB", (grid.width, header + grid.height), PAPER)
    draw, top = ImageDraw.Draw(sheet), GAP
    for text, size, color in texts:
        draw.text((GAP, top), text, fill=color, font=ImageFont.load_default(size))
        top += size + GAP // 2
    sheet.paste(grid, (0, header))
    return sheet


def gallery(panels: Sequence[Panel], columns: int, panel_width: int = PANEL_WIDTH) -> Image.Image:
    """Panels, at least one, in rows, their pictures scaled to a width in pixels."""
    pictures = [_draw_panel(panel, panel_width) for panel in panels]
    width, height = (side + GAP for side in pictures[0].size)
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (columns * width + GAP, rows * height + GAP), PAPER)
    for index, picture in enumerate(pictures):
        row, column = divmod(index, columns)
        sheet.paste(picture, (GAP + column * width, GAP + row * height))
    return sheet


def _draw_panel(panel: Panel, width: int) -> Image.Image:
    height = round(width * panel.rgb.shape[0] / panel.rgb.shape[1])
    framed = Image.new("RGB", (width, height + CAPTION_HEIGHT), PAPER)
    framed.paste(Image.fromarray(panel.rgb).resize((width, height), Image.Resampling.LANCZOS))
    draw, font = ImageDraw.Draw(framed), ImageFont.load_default(CAPTION_SIZE)
    is_plain = panel.color == INK
    if not is_plain:
        draw.rectangle((0, 0, width - 1, height - 1), outline=panel.color, width=4)
    baseline = height + CAPTION_HEIGHT - 9
    draw.text((2, baseline), panel.caption, fill=panel.color, font=font, anchor="ls")
    draw.text(
        (width - 2, baseline), panel.note, fill=GREY if is_plain else panel.color, font=font, anchor="rs"
    )
    return framed
