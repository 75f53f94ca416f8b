"""Tables for the terminal, in which no word is ever cut."""

import shutil
import textwrap
from collections.abc import Iterable, Sequence

UNBOUNDED = 10_000
"""Columns of a file or a pipe, which has no width."""
GUTTER = "  "
INDENT = "    "


def print_table(headings: Sequence[str], rows: Iterable[Sequence[object]], title: str = "") -> None:
    """Print a table as wide as its cells; where the terminal is narrower, a paragraph for each row.

    Args:
        headings: of the columns; the first is aligned left, the others right.
        rows: cells, shown by `str`, as many as headings; the first one names its row.
        title: a line above.
    """
    lines = [tuple(map(str, row)) for row in rows]
    columns = shutil.get_terminal_size((UNBOUNDED, 24)).columns
    if title:
        print(textwrap.fill(title, columns, break_long_words=False, break_on_hyphens=False))
    widths = [max(map(len, column)) for column in zip(headings, *lines, strict=True)]
    if sum(widths) + len(GUTTER) * (len(widths) - 1) <= columns:
        for line in (headings, ["-" * width for width in widths], *lines):
            cells = [
                line[0].ljust(widths[0]),
                *(c.rjust(w) for c, w in zip(line[1:], widths[1:], strict=True)),
            ]
            print(GUTTER.join(cells).rstrip())
    else:
        for line in lines:
            print("\n".join(_paragraph(headings, line, columns)))


def _paragraph(headings: Sequence[str], row: Sequence[str], columns: int) -> Iterable[str]:
    """The row's name, then its other cells one below the other; an empty cell has no line."""
    yield f"{headings[0]}: {row[0]}"
    width = max(map(len, headings[1:]), default=0)
    for heading, cell in zip(headings[1:], row[1:], strict=True):
        if cell:
            head = f"{INDENT}{heading:<{width}}{GUTTER}"
            yield textwrap.fill(
                cell,
                columns,
                initial_indent=head,
                subsequent_indent=" " * len(head),
                break_long_words=False,
                break_on_hyphens=False,
            )
