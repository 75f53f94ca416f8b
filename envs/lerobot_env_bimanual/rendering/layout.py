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
SEAM = 4
TITLE_SIZE, TEXT_SIZE, CAPTION_SIZE = 34, 21, 19

PAPER = (255, 255, 255)
INK = (32, 34, 40)
GREY = (112, 116, 126)
GREEN = (22, 128, 60)
RED = (196, 38, 34)


@dataclass(frozen=True, eq=False)
class Panel:
    """A picture, perhaps a second one beside it, with a line of text below.

    Attributes:
        rgb: (height, width, 3) uint8; all panels of a sheet have the same shape.
        caption: text at the left end of the line.
        note: text at its right end.
        color: RGB of both texts; a colour other than `INK` also frames the picture.
        beside: (height, width, 3) uint8, the second picture; it is scaled to the height of the first.
    """

    rgb: NDArray[np.uint8]
    caption: str
    note: str = ""
    color: tuple[int, int, int] = INK
    beside: NDArray[np.uint8] | None = None


def contact_sheet(title: str, lines: Sequence[str], panels: Sequence[Panel], columns: int = 4) -> Image.Image:
    """Panels in rows under a title and lines of text."""
    grid = gallery(panels, columns, centred=False)
    texts = [(title, TITLE_SIZE, INK), *((line, TEXT_SIZE, GREY) for line in lines)]
    header = GAP + sum(size + GAP // 2 for _, size, _ in texts)
    sheet = Image.new("RGB", (grid.width, header + grid.height), PAPER)
    draw, top = ImageDraw.Draw(sheet), GAP
    for text, size, color in texts:
        draw.text((GAP, top), text, fill=color, font=ImageFont.load_default(size))
        top += size + GAP // 2
    sheet.paste(grid, (0, header))
    return sheet


def gallery(
    panels: Sequence[Panel], columns: int = 3, centred: bool = True, panel_width: int = PANEL_WIDTH
) -> Image.Image:
    """Panels in rows.

    Args:
        panels: at least one.
        columns: number of columns.
        centred: whether a last row that is not full is in the middle, not at the left.
        panel_width: width to which pictures are scaled, pixels.
    """
    pictures = [_draw_panel(panel, panel_width) for panel in panels]
    width, height = (side + GAP for side in pictures[0].size)
    columns = min(columns, len(pictures))
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (columns * width + GAP, rows * height + GAP), PAPER)
    for index, picture in enumerate(pictures):
        row, column = divmod(index, columns)
        missing = columns - min(columns, len(pictures) - row * columns)
        left = GAP + column * width + (missing * width // 2 if centred else 0)
        sheet.paste(picture, (left, GAP + row * height))
    return sheet


def scaled(rgb: NDArray[np.uint8], width: int) -> Image.Image:
    """A picture brought to a width in pixels."""
    height = round(width * rgb.shape[0] / rgb.shape[1])
    return Image.fromarray(rgb).resize((width, height), Image.Resampling.LANCZOS)


def _draw_panel(panel: Panel, panel_width: int) -> Image.Image:
    pictures = [scaled(panel.rgb, panel_width)]
    height = pictures[0].height
    if panel.beside is not None:
        pictures.append(scaled(panel.beside, round(height * panel.beside.shape[1] / panel.beside.shape[0])))
    width = sum(picture.width for picture in pictures) + SEAM * (len(pictures) - 1)
    framed = Image.new("RGB", (width, height + CAPTION_HEIGHT), PAPER)
    framed.paste(pictures[0])
    framed.paste(pictures[-1], (width - pictures[-1].width, 0))
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
