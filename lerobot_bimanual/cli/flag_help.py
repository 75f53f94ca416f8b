"""The help text of a dataclass's flags, taken from the comments beside, above, or the string below its fields.

draccus has a reader of such comments too; it misses fields whose annotation holds quotes (`Literal["a"]`) and
its printer fails on a per cent sign.
"""

import ast
import dataclasses
import inspect
import shutil
import textwrap
import tokenize
from collections.abc import Iterator
from io import StringIO
from typing import Any

from lerobot_bimanual.cli.flags import CONFIG_FLAG, Flag, flags_of

COLUMN = 28
MAX_WIDTH = 110
NOTHING = (None, "", ())
"""Defaults that say nothing by themselves."""


def describe_flags(config_type: type) -> str:
    """One paragraph per flag: name, kind of value, help text and default."""
    width = min(MAX_WIDTH, shutil.get_terminal_size((MAX_WIDTH, 24)).columns)
    rows = [(f"--{flag.name}={flag.value_name}", _text(flag)) for flag in flags_of(config_type)]
    rows.append((f"--{CONFIG_FLAG}=path", "read values from a YAML file; flags on the command line win"))
    return "\n".join(_paragraph(head, text, width) for head, text in rows)


def field_comments(config_type: type) -> dict[str, str]:
    """Help text of each field of a dataclass, its base classes included; fields without a comment are absent."""
    comments: dict[str, str] = {}
    for owner in reversed(config_type.__mro__):
        if dataclasses.is_dataclass(owner):
            comments.update(_own_comments(textwrap.dedent(inspect.getsource(owner))))
    return comments


def _own_comments(source: str) -> Iterator[tuple[str, str]]:
    lines = source.splitlines()
    tokens = tokenize.generate_tokens(StringIO(source).readline)
    comment_at = {
        token.start[0]: token.string.lstrip("# ") for token in tokens if token.type == tokenize.COMMENT
    }
    body = next(node for node in ast.parse(source).body if isinstance(node, ast.ClassDef)).body
    for node, below in zip(body, [*body[1:], None], strict=True):
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        beside = comment_at.get(node.end_lineno or node.lineno, "")
        above: list[str] = []
        row = node.lineno - 1
        while row in comment_at and lines[row - 1].lstrip().startswith("#"):
            above.insert(0, comment_at[row])
            row -= 1
        text = beside or " ".join(above)
        if not text and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            text = str(below.value.value)
        if text:
            yield node.target.id, " ".join(text.split())


def _text(flag: Flag) -> str:
    comment = field_comments(flag.owner).get(flag.name.rpartition(".")[2], "")
    if flag.default in NOTHING and "by default" in comment.lower():
        return comment  # which says better what happens
    return f"{comment} {_default(flag.default)}".strip()


def _default(default: Any) -> str:
    if default is dataclasses.MISSING:
        return "(required)"
    if default in NOTHING:
        return "(default: none)"
    if isinstance(default, tuple | list):
        return f"(default: {','.join(str(item) for item in default)})"
    return f"(default: {str(default).lower() if isinstance(default, bool) else default})"


def _paragraph(head: str, text: str, width: int) -> str:
    indent = " " * COLUMN
    body = textwrap.fill(text, width, initial_indent=indent, subsequent_indent=indent)
    if len(head) + 2 < COLUMN - 1:
        return f"  {head}".ljust(COLUMN) + body.lstrip()
    return f"  {head}\n{body}"
