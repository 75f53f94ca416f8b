"""Pages that are written from measurements, and their tables."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from lerobot_bimanual.output_file import write_file


def markdown_table(headings: Sequence[str], rows: Iterable[Sequence[object]], of_words: bool = False) -> str:
    """A Markdown table; the first column is aligned left, the others right, or left in a table of words."""
    lines = [headings, ["---", *("---" if of_words else "---:" for _ in headings[1:])], *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


@dataclass(frozen=True)
class MarkdownTable:
    """A table whose text is Markdown, and whose single rows can be shown upright.

    Attributes:
        headings: of the columns.
        rows: cells; the first of each names its row.
    """

    headings: Sequence[str]
    rows: Sequence[Sequence[object]]

    def __str__(self) -> str:
        """All of it."""
        return markdown_table(self.headings, self.rows)

    def upright(self, *names: str) -> str:
        """Some rows as columns, one line per heading but the first; a name without a row is left out.

        Args:
            names: first cells of the rows; the first one is the subject of the page, and its column bears no name.
        """
        by_name = {str(row[0]): row for row in self.rows}
        shown = [name for name in names if name in by_name]
        lines = zip(self.headings[1:], *(by_name[name][1:] for name in shown), strict=True)
        return markdown_table(("figure", "value", *shown[1:]), lines)


def write_page(page: str, output: Path | None) -> None:
    """Write a page to a file, whose folder is made; print it if there is no file.

    Raises:
        UnwritableOutput: the file cannot be written.
    """
    if output is None:
        sys.stdout.write(page)
        return
    write_file(output, page)
