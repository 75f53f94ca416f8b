"""Lays labelled pictures out on a sheet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

PANEL_WIDTH = 400
CAPTION_HEIGHT = 34
GAP = 16
SEAM = 4
TITLE_SIZE = 34
TEXT_SIZE = 21
CAPTION_SIZE = 19

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
        caption: the line, from the left.
        note: a remark at the line's right end.
        color: RGB of both texts; coloured ones get a frame of the same colour.
        beside: (height, width, 3) uint8, the second picture; it is brought to the height of the first.
    """

    rgb: NDArray[np.uint8]
    caption: str
    note: str = ""
    color: tuple[int, int, int] = INK
    beside: NDArray[np.uint8] | None = None


def contact_sheet(title: str, lines: Sequence[str], panels: Sequence[Panel], columns: int = 4) -> Image.Image:
    """Panels in rows under a title and lines of text."""
    grid = _grid(panels, columns, centred=False)
    heights = [TITLE_SIZE, *[TEXT_SIZE] * len(lines)]
    header = GAP + sum(height + GAP // 2 for height in heights)
    sheet = Image.new("RGB", (grid.width, header + grid.height), PAPER)
    draw = ImageDraw.Draw(sheet)
    top = GAP
    for text, height, color in zip((title, *lines), heights, (INK, INK, *[GREY] * len(lines)), strict=False):
        draw.text((GAP, top), text, fill=color, font=ImageFont.load_default(height))
        top += height + GAP // 2
    sheet.paste(grid, (0, header))
    return sheet


def gallery(panels: Sequence[Panel], columns: int = 3) -> Image.Image:
    """Panels in rows; a last row that is not full stands in the middle."""
    return _grid(panels, columns, centred=True)


def moving_gallery(strips: Mapping[str, Sequence[NDArray[np.uint8]]], columns: int = 5) -> list[Image.Image]:
    """Episodes in rows, each with its name, all moving at once.

    Args:
        strips: name of each episode -> its pictures, (height, width, 3) uint8, equally many of one shape.
        columns: of episodes.

    Returns:
        One picture per moment.
    """
    moments = zip(*strips.values(), strict=True)
    panels = [[Panel(rgb, name) for name, rgb in zip(strips, moment, strict=True)] for moment in moments]
    return [_grid(moment, columns, centred=True, panel_width=moment[0].rgb.shape[1]) for moment in panels]


def _grid(
    panels: Sequence[Panel], columns: int, centred: bool, panel_width: int = PANEL_WIDTH
) -> Image.Image:
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


def _draw_panel(panel: Panel, panel_width: int) -> Image.Image:
    first = Image.fromarray(panel.rgb)
    height = round(panel_width * first.height / first.width)
    pictures = [first.resize((panel_width, height), Image.Resampling.LANCZOS)]
    if panel.beside is not None:
        second = Image.fromarray(panel.beside)
        width = round(height * second.width / second.height)
        pictures.append(second.resize((width, height), Image.Resampling.LANCZOS))
    width = sum(picture.width for picture in pictures) + SEAM * (len(pictures) - 1)
    framed = Image.new("RGB", (width, height + CAPTION_HEIGHT), PAPER)
    framed.paste(pictures[0])
    framed.paste(pictures[-1], (width - pictures[-1].width, 0))
    draw, font = ImageDraw.Draw(framed), ImageFont.load_default(CAPTION_SIZE)
    if panel.color != INK:
        draw.rectangle((0, 0, width - 1, height - 1), outline=panel.color, width=4)
    baseline = height + CAPTION_HEIGHT - 9
    draw.text((2, baseline), panel.caption, fill=panel.color, font=font, anchor="ls")
    note_color = GREY if panel.color == INK else panel.color
    draw.text((width - 2, baseline), panel.note, fill=note_color, font=font, anchor="rs")
    return framed
