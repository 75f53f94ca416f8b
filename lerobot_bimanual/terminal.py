"""What commands print: tables in which no word is ever cut, and the command that comes next."""

import shlex
import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence
from functools import partial
from io import StringIO

UNBOUNDED = 10_000
"""Columns of a file or a pipe, which has no width."""


def print_table(headings: Sequence[str], rows: Iterable[Sequence[object]], title: str = "") -> None:
    """Print a table as wide as its cells; on a narrower terminal, a paragraph for each row.

    Args:
        headings: names of the columns; the first column is aligned left, the others right.
        rows: cells, shown by `str`, as many as headings.
        title: a line above.
    """
    from rich.console import Console
    from rich.table import Table

    columns = shutil.get_terminal_size((UNBOUNDED, 24)).columns
    wrap = partial(textwrap.fill, width=columns, break_long_words=False, break_on_hyphens=False)
    table = Table(*headings, box=None, pad_edge=False)
    for column in table.columns[1:]:
        column.justify = "right"
    lines = [tuple(map(str, row)) for row in rows]
    for line in lines:
        table.add_row(*line)
    console = Console(file=StringIO(), width=UNBOUNDED, markup=False, highlight=False, emoji=False)
    if title:
        print(wrap(title))
    if console.measure(table).maximum > columns:
        for first, *others in lines:
            print(f"{headings[0]}: {first}")
            for heading, cell in zip(headings[1:], others, strict=True):
                print(wrap(f"{heading}: {cell}", initial_indent="    ", subsequent_indent="      "))
        return
    with console.capture() as captured:
        console.print(table)
    print("\n".join(line.rstrip() for line in captured.get().splitlines()))


def show_next(*words: object) -> None:
    """Print the command that continues the work, as the last line of a command.

    It goes to stderr, because programs may read what a command prints.

    Args:
        words: words of the command, the program's name included.
    """
    print(f"next: {shlex.join(map(str, words))}", file=sys.stderr)
