"""What commands print: tables in which no word is ever cut, and the command that comes next."""

from __future__ import annotations

import shlex
import shutil
import sys
import textwrap
from functools import partial
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import MAX_MESSAGE, plain

if TYPE_CHECKING:
    import pandas as pd

UNBOUNDED = 10_000
"""Columns of a file or a pipe, which has no width."""


def print_table(table: pd.DataFrame, title: str = "") -> None:
    """Print a table as wide as its cells, below its title; on a narrower terminal, a paragraph for each row.

    Cells are shown by `str`; the first column is aligned left, the others right.
    """
    columns = shutil.get_terminal_size((UNBOUNDED, 24)).columns
    wrap = partial(textwrap.fill, width=columns, break_long_words=False, break_on_hyphens=False)
    table = table.map(plain).rename(columns=plain)
    align = ["left", *["right"] * (len(table.columns) - 1)]
    text = table.to_markdown(index=False, tablefmt="plain", disable_numparse=True, colalign=align)
    lines = [line.rstrip() for line in str(text).splitlines()]
    if title:
        print(wrap(plain(title, MAX_MESSAGE)))
    if max(map(len, lines)) <= columns:
        print("\n".join(lines))
        return
    for row in table.to_dict("records"):
        (heading, first), *others = row.items()
        print(f"{heading}: {first}")
        for heading, cell in others:
            print(wrap(f"{heading}: {cell}", initial_indent="    ", subsequent_indent="      "))


def say(*lines: object) -> None:
    """Print lines that may contain text of a file: one line each, control characters escaped, cut to `MAX_MESSAGE`."""
    for line in lines:
        print(plain(line, MAX_MESSAGE))


def show_next(*words: object) -> None:
    """Print the command that continues the work, the program's name included, as the last line of a command.

    It goes to stderr, because programs may read what a command prints.
    """
    print(plain(f"next: {shlex.join(map(str, words))}", MAX_MESSAGE), file=sys.stderr)
