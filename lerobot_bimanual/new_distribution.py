"""Writes a distribution of a user's own from one that works, in which every form of its name is replaced."""

import re
from pathlib import Path

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.files import write_file
from lerobot_bimanual.terminal import say


def write_distribution(template: Path, old: str, name: str, target: Path) -> None:
    """Write a distribution, and print its files.

    Args:
        template: folder of the one that works.
        old: its name.
        name: the new one, in small letters, digits and underscores.
        target: a new folder.

    Raises:
        BimanualError: the name is none, the folder is there already, or it cannot be written.
    """
    if not re.fullmatch("[a-z][a-z0-9]*(_[a-z0-9]+)*", name):
        raise InvalidChoice("name", name, "small letters and digits, with underscores between words")
    if target.exists():
        raise BimanualError(f"{target} is there already: choose another --output")
    forms = list(zip(_forms(old), _forms(name), strict=True))
    for source in sorted(template.rglob("*")):
        if source.is_file() and "__pycache__" not in source.parts:
            text = source.read_text(encoding="utf-8")
            for before, after in forms:
                text = text.replace(before, after)
            path = target / str(source.relative_to(template)).replace(old, name)
            write_file(path, text)
            say(path)


def _forms(name: str) -> tuple[str, str, str]:
    """A name as identifier, as class and in words."""
    words = name.split("_")
    return name, "".join(word.capitalize() for word in words), " ".join(words)
