"""Text that comes from a file, made harmless where it is printed: on a terminal, and in a page of Markdown or HTML."""

import re

MAX_TEXT = 200
"""Characters of one text of a file that are printed."""
MAX_MESSAGE = 4000
"""Characters of an error: none of ours is as long, but with a text of a file in it."""
CODE_SPAN = re.compile(r"(`[^`|<>&]+`)")
MARKUP = {ord(character): f"&#{ord(character)};" for character in "&<>`|[]{}\\"}
"""All with which Markdown, or HTML inside it, begins a link, a tag, code, a cell or attributes."""


def plain(text: object, limit: int = MAX_TEXT) -> str:
    r"""A text on one line, cut to a length, its control characters written out as `\x1b`."""
    text = str(text)
    text = text if len(text) <= limit else f"{text[:limit]}..."
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def shown(value: object) -> str:
    """The representation of a value, for a sentence: quotes tell where a text begins and ends."""
    return plain(repr(value[: MAX_TEXT + 1] if isinstance(value, str | bytes) else value))


def markdown(text: object, limit: int = MAX_TEXT) -> str:
    """A text for a paragraph or a cell of a table in Markdown: code spans and emphasis stay, all else is text."""
    parts = CODE_SPAN.split(plain(text, limit))
    return "".join(part if CODE_SPAN.fullmatch(part) else part.translate(MARKUP) for part in parts)
