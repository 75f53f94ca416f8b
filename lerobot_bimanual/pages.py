"""Pages that are written from results by templates, and their tables."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lerobot_bimanual.errors import MAX_MESSAGE, MAX_TEXT, plain
from lerobot_bimanual.files import write_file

if TYPE_CHECKING:
    import pandas as pd

CODE_SPAN = re.compile(r"(`[^`|<>&]+`)")
MARKUP = {ord(character): f"&#{ord(character)};" for character in "&<>`|[]{}\\"}
"""Escapes of the characters that begin a link, a tag, code, a cell or attributes in Markdown or in HTML inside it."""


def escape_markdown(text: object, limit: int = MAX_TEXT) -> str:
    """Escape a text for a paragraph or a table cell in Markdown; code spans and emphasis are kept."""
    parts = CODE_SPAN.split(plain(text, limit))
    return "".join(part if CODE_SPAN.fullmatch(part) else part.translate(MARKUP) for part in parts)


def render(package: str, template: str, **values: object) -> str:
    """Fill in a template; data frames become Markdown tables by the filter `table`.

    Args:
        package: the Python package that holds the folder `templates`.
        template: name of the file. Inserted values are escaped, since names and sentences may come from any file, except
            the output of the filter `safe`, and of `join`, `fence` and tables, which escape by themselves.
        values: values of the names in the template; a name without a value is an error.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def escaped(value: object) -> object:
        return escape_markdown(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    environment = Environment(
        loader=PackageLoader(package),
        finalize=escaped,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "table": lambda *arguments, **options: Markup(markdown_table(*arguments, **options)),
        "fence": lambda text: Markup(
            plain("".join(map(plain, re.split("([ ,])", text))), MAX_MESSAGE).replace("`", "'")
        ),
        "join": lambda values, by: Markup(by.join(map(escape_markdown, values))),
    }
    return environment.get_template(template).render(values)


def markdown_table(frame: pd.DataFrame, words: bool = False) -> str:
    """A Markdown table; the first column is aligned left, the others right, or left in a table of words."""
    align = ["left", *["left" if words else "right"] * (len(frame.columns) - 1)]
    frame = frame.map(lambda cell: escape_markdown(cell) if isinstance(cell, str) else cell).rename(
        columns=escape_markdown
    )
    text = frame.to_markdown(index=False, disable_numparse=True, colalign=align)
    assert text is not None  # it goes to no file
    return text


def write_page(page: str, output: Path | None) -> None:
    """Write a page to a file, as `write_file` does; print it if there is no file."""
    if output is None:
        sys.stdout.write(page)
    else:
        write_file(output, page)
