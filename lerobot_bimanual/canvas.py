"""A sheet that charts are drawn on, in colours that the colour-blind tell apart and that differ in grey, too.

Pillow draws it, as it does all our pictures: LeRobot brings it along, while a plotting library would be one more package
for three figures.
"""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Literal

from PIL import Image, ImageDraw, ImageFont
from PIL.PngImagePlugin import PngInfo

from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.output_file import check_output_file, write_file

type Color = tuple[int, int, int]
type Mark = Literal["circle", "square", "diamond", "triangle", "cross"]

PAPER: Color = (255, 255, 255)
INK: Color = (32, 34, 40)
GREY: Color = (112, 116, 126)
PALE: Color = (222, 224, 229)
BLUE: Color = (0, 114, 178)
ORANGE: Color = (230, 159, 0)
GREEN: Color = (0, 158, 115)
YELLOW: Color = (240, 228, 66)
PURPLE: Color = (204, 121, 167)
VERMILION: Color = (213, 94, 0)
"""Okabe and Ito's colours."""

WIDTH = 800
"""Pixels in which a chart is laid out; its file has `PIXELS` times as many, for sharp letters on any screen."""
PIXELS = 2
SMOOTHING = 2
"""Lines are drawn so many times larger and scaled down, since Pillow draws them with hard edges."""

HATCHING = 5
"""Between the lines of a hatching, along an edge."""

DESCRIPTION = "Description"
"""Key of the PNG's text that says in words what is drawn."""


def check_figure_file(path: Path) -> None:
    """As `check_output_file`, of a file that a canvas will be saved to.

    Raises:
        UnwritableOutput: it could not be written.
        InvalidChoice: it has the name of another kind of file.
    """
    check_output_file(path)
    if path.suffix.lower() != ".png":
        raise InvalidChoice("figure", str(path), "a path that ends in .png")


class Canvas:
    """A white sheet; lengths are in pixels of the layout, from the upper left corner.

    Args:
        height: of the sheet, `WIDTH` wide.
        description: what is drawn, in words, for those who cannot see it.
    """

    def __init__(self, height: float, description: str):
        self.description = description
        self._scale = PIXELS * SMOOTHING
        self._image = Image.new("RGB", (WIDTH * self._scale, round(height * self._scale)), PAPER)
        self._draw = ImageDraw.Draw(self._image)

    def text(
        self,
        x: float,
        y: float,
        text: str,
        color: Color = INK,
        size: float = 13,
        anchor: str = "lm",
        room: float = WIDTH,
    ) -> None:
        """A line of text at a point.

        Args:
            x: of the point.
            y: of the point.
            text: whose end is left out where it is wider than `room`.
            color: of the letters.
            size: of the letters.
            anchor: Pillow's, for where the point lies in the text: l, m or r for left, middle or right, then t, m or b for
                top, middle or bottom.
            room: greatest width.
        """
        if (width := self.text_width(text, size)) > room:
            text = text[: int(len(text) * room / width)]
            while text and self.text_width(f"{text}…", size) > room:
                text = text[:-1]
            text += "…"
        self._draw.text(self._at(x, y), text, color, ImageFont.load_default(size * self._scale), anchor)

    def text_width(self, text: str, size: float = 13) -> float:
        """How wide a line of text is."""
        return self._draw.textlength(text, ImageFont.load_default(size * self._scale)) / self._scale

    def line(
        self, start: tuple[float, float], end: tuple[float, float], color: Color = INK, width: float = 1
    ) -> None:
        """A straight line."""
        self._draw.line((*self._at(*start), *self._at(*end)), color, round(width * self._scale))

    def rectangle(
        self, left: float, top: float, right: float, bottom: float, fill: Color, outline: Color | None = None
    ) -> None:
        """A filled rectangle."""
        corners = (*self._at(left, top), *self._at(right, bottom))
        self._draw.rectangle(corners, fill, outline, width=self._scale)

    def area(self, corners: Sequence[tuple[float, float]], fill: Color) -> None:
        """A filled polygon."""
        self._draw.polygon([self._at(*corner) for corner in corners], fill)

    def hatching(self, left: float, top: float, right: float, bottom: float, color: Color = PALE) -> None:
        """Diagonal lines over a rectangle."""
        width, height = right - left, bottom - top
        for offset in range(HATCHING, int(width + height), HATCHING):
            start = (left + max(0, offset - height), top + min(offset, height))
            end = (left + min(offset, width), top + max(0, offset - width))
            self.line(start, end, color)

    def mark(
        self, kind: Mark, x: float, y: float, color: Color, radius: float = 5, hollow: bool = False
    ) -> None:
        """A mark around a point, filled or hollow."""
        r = radius
        if kind == "cross":
            self.line((x - r, y - r), (x + r, y + r), color, 2)
            self.line((x - r, y + r), (x + r, y - r), color, 2)
            return
        fill, width = PAPER if hollow else color, round(1.5 * self._scale)
        if kind == "circle":
            self._draw.ellipse((*self._at(x - r, y - r), *self._at(x + r, y + r)), fill, color, width)
            return
        corners = {
            "square": [(-0.88, -0.88), (0.88, -0.88), (0.88, 0.88), (-0.88, 0.88)],
            "diamond": [(0, -1.2), (1.2, 0), (0, 1.2), (-1.2, 0)],
            "triangle": [(0, -1.1), (1.1, 0.9), (-1.1, 0.9)],
        }[kind]
        self._draw.polygon([self._at(x + r * dx, y + r * dy) for dx, dy in corners], fill, color, width)

    def image(self) -> Image.Image:
        """The sheet as it is now."""
        return self._image.reduce(SMOOTHING)

    def png(self) -> bytes:
        """The sheet as a PNG file that holds its description."""
        info, file = PngInfo(), BytesIO()
        info.add_itxt(DESCRIPTION, self.description)
        self.image().save(file, "png", optimize=True, pnginfo=info)
        return file.getvalue()

    def save(self, path: Path) -> None:
        """Write the PNG file.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        write_file(path, self.png())

    def _at(self, x: float, y: float) -> tuple[float, float]:
        return x * self._scale, y * self._scale
