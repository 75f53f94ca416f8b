"""The help text of a dataclass's flags, taken from the comments beside or above its fields.

draccus has a reader of such comments too; it misses fields whose annotation holds quotes (`Literal["a"]`) and
its printer fails on a per cent sign.
"""

import dataclasses
import inspect
import re
import shutil
import textwrap
from typing import Any

from lerobot_bimanual.cli.flags import CONFIG_FLAG, Flag, flags_of

COLUMN = 28
MAX_WIDTH = 110
EMPTY = (None, "", ())
"""Defaults that say nothing by themselves."""
FIELD = re.compile(r"    (\w+): .*?(?:  # (.*))?")
COMMENT = re.compile(r"    # (.*)")


def describe_flags(config_type: type) -> str:
    """One paragraph per flag: name, kind of value, help text and default."""
    width = min(MAX_WIDTH, shutil.get_terminal_size((MAX_WIDTH, 24)).columns)
    rows = [(f"--{flag.name}={flag.value_name}", _text(flag)) for flag in flags_of(config_type)]
    rows.append((f"--{CONFIG_FLAG}=path", "read values from a YAML file; flags on the command line win"))
    return "\n".join(_paragraph(head, text, width) for head, text in rows)


def field_comments(config_type: type) -> dict[str, str]:
    """Help text of each field of a dataclass, its base classes included; fields without a comment are absent."""
    comments: dict[str, str] = {}
    for owner in reversed(config_type.__mro__[:-1]):
        above: list[str] = []
        for line in textwrap.dedent(inspect.getsource(owner)).splitlines():
            if comment := COMMENT.fullmatch(line):
                above.append(comment[1])
                continue
            if (field := FIELD.fullmatch(line)) and (text := field[2] or " ".join(above)):
                comments[field[1]] = text
            above = []
    return comments


def _text(flag: Flag) -> str:
    comment = field_comments(flag.owner).get(flag.name, "")
    if flag.default in EMPTY and "by default" in comment.lower():
        return comment  # which says better what happens
    return f"{comment} {_default(flag.default)}".strip()


def _default(default: Any) -> str:
    if default is dataclasses.MISSING:
        return "(required)"
    if default in EMPTY:
        return "(default: none)"
    if isinstance(default, tuple):
        return f"(default: {','.join(str(item) for item in default)})"
    return f"(default: {str(default).lower() if isinstance(default, bool) else default})"


def _paragraph(head: str, text: str, width: int) -> str:
    indent = " " * COLUMN
    body = textwrap.fill(text, width, initial_indent=indent, subsequent_indent=indent)
    if len(head) + 2 < COLUMN - 1:
        return f"  {head}".ljust(COLUMN) + body.lstrip()
    return f"  {head}\n{body}"
