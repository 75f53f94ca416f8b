"""Pages that are written from measurements, and their tables."""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from lerobot_bimanual.output_file import write_file


def markdown_table(headings: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; the first column is aligned left, the others right."""
    lines = [headings, ["---", *("---:" for _ in headings[1:])], *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def write_page(page: str, output: Path | None) -> None:
    """Write a page to a file, whose folder is made; print it if there is no file.

    Raises:
        UnwritableOutput: the file cannot be written.
    """
    if output is None:
        sys.stdout.write(page)
        return
    write_file(output, page)
