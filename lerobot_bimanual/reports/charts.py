"""Charts, in colours that the colour-blind tell apart and that differ in grey, too."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from lerobot_bimanual.files import write_file

INK, GREY, PALE = "#202228", "#70747e", "#dee0e5"
BLUE, ORANGE, GREEN, YELLOW, PURPLE, VERMILION = (
    "#0072b2",
    "#e69f00",
    "#009e73",
    "#f0e442",
    "#cc79a7",
    "#d55e00",
)
"""Okabe and Ito's colours."""

WIDTH_IN = 8.0
DPI = 150


styled = matplotlib.rc_context(
    {
        "font.size": 9,
        "text.parse_math": False,  # names come from any file
        "text.color": INK,
        "axes.edgecolor": PALE,
        "axes.labelcolor": GREY,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlelocation": "left",
        "axes.titlesize": 9,
        "xtick.color": PALE,
        "xtick.labelcolor": GREY,
        "ytick.color": PALE,
        "ytick.labelcolor": INK,
        "grid.color": PALE,
        "hatch.color": PALE,
        "legend.frameon": False,
        "figure.constrained_layout.use": True,
    }
)
"""Decorates functions that draw."""


@dataclass(frozen=True)
class Chart:
    """A drawn figure.

    Attributes:
        figure: as matplotlib has it.
        description: what is drawn, in words, for readers who cannot see it.
    """

    figure: Figure
    description: str

    def png(self) -> bytes:
        """The chart as a PNG file that holds its description."""
        file = BytesIO()
        metadata = {"Description": self.description, "Software": None}
        self.figure.savefig(file, format="png", dpi=DPI, metadata=metadata, pil_kwargs={"optimize": True})
        return file.getvalue()

    def save(self, path: Path) -> None:
        """Write the PNG file.

        Raises:
            UnwritableOutput: it cannot be written.
        """
        write_file(path, self.png())


def new_figure(height_in: float, title: str, *notes: str) -> Figure:
    """An empty figure with a title above and lines of text below."""
    figure = Figure(figsize=(WIDTH_IN, height_in))
    figure.suptitle(title, x=0.01, ha="left", fontsize=13)
    figure.supxlabel("\n".join(notes), x=0.01, ha="left", fontsize=8, color=GREY)
    return figure
