"""Command-line flags of a dataclass, whose values are decoded by draccus, LeRobot's own configuration library.

Every field is a flag, `--name=value` or `--name value`. The comment beside or above a field is its help text. draccus
has a reader of such comments too; it misses fields whose annotation holds quotes (`Literal["a"]`) and its printer fails
on a per cent sign.

draccus' own command line reads values as YAML 1.1, which alters some texts in silence, and takes a text that begins
with `include` for the name of a file to read. Here every value reaches draccus as the text that was typed:
- a `str` or `Path` field takes it unchanged (YAML reads `10:30` as the number 630 and `010` as 8);
- a `tuple` field takes a comma list, `--cameras=front,left_wrist`;
- a `bool` field may stand alone, `--force` for `--force=true`.

Use `Literal["a", "b"]` for a choice, and `X | None = None` for what may be absent (`--name=null` sets None).
"""

import dataclasses
import inspect
import re
import shutil
import textwrap
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.errors import BimanualError, InvalidChoice, did_you_mean, plain, shown

VALUE_NAMES: dict[Any, str] = {bool: "true|false", str: "text", Path: "path"}
MEANINGS: dict[Any, str] = {int: "an integer", float: "a number", bool: "true or false"}
HELP_COLUMN = 28
MAX_HELP_WIDTH = 110
FIELD = re.compile(r"    (\w+): .*?(?:  # (.*))?")
COMMENT = re.compile(r"    # (.*)")


class BadCommandLine(BimanualError):
    """The user's command line cannot be understood; the message says what would be valid."""

    exit_code = 2


@dataclasses.dataclass(frozen=True)
class Flag:
    """One field of a config as the command line sees it.

    Attributes:
        kind: the field's annotation without `| None`, which `optional` says.
        default: the default value; `dataclasses.MISSING` if the flag is required.
    """

    name: str
    kind: Any
    optional: bool
    default: Any

    @property
    def is_list(self) -> bool:
        """Whether the value is a comma list."""
        return typing.get_origin(self.kind) is tuple

    @property
    def value_name(self) -> str:
        """Placeholder of the value in a help text."""
        if typing.get_origin(self.kind) is Literal:
            return "|".join(str(choice) for choice in typing.get_args(self.kind))
        if self.is_list:
            return "a,b,..."
        return VALUE_NAMES.get(self.kind) or getattr(self.kind, "__name__", str(self.kind))


def flags_of(config_type: type) -> list[Flag]:
    """The flags of a dataclass in the order of its fields."""
    hints = typing.get_type_hints(config_type)
    return [
        Flag(field.name, *_without_none(hints[field.name]), field.default)
        for field in dataclasses.fields(config_type)
    ]


def parse_flags[Config](config_type: type[Config], words: Sequence[str]) -> Config:
    """Build a config from command-line words.

    Raises:
        BadCommandLine: a word is not a flag, a flag is unknown, missing or lacks its value, or a value does not fit.
    """
    flags = {flag.name: flag for flag in flags_of(config_type)}
    values = dict(_assignments(words, flags))
    required = [flag for flag in flags.values() if flag.default is dataclasses.MISSING]
    if missing := [f"--{flag.name}={flag.value_name}" for flag in required if flag.name not in values]:
        raise BadCommandLine(f"missing: {' '.join(missing)}. `--help` explains every flag.")
    return config_type(**{name: _decode(value, flags[name]) for name, value in values.items()})


def describe_flags(config_type: type) -> str:
    """The help text of the flags, one paragraph each: name, kind of value, comment and default."""
    width = min(MAX_HELP_WIDTH, shutil.get_terminal_size((MAX_HELP_WIDTH, 24)).columns)
    comments, indent = field_comments(config_type), " " * HELP_COLUMN
    paragraphs = []
    for flag in flags_of(config_type):
        head = f"  --{flag.name}={flag.value_name}"
        body = textwrap.fill(_help(flag, comments), width, initial_indent=indent, subsequent_indent=indent)
        is_short = len(head) + 1 < HELP_COLUMN
        paragraphs.append(head.ljust(HELP_COLUMN) + body.lstrip() if is_short else f"{head}\n{body}")
    return "\n".join(paragraphs)


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


def _help(flag: Flag, comments: Mapping[str, str]) -> str:
    """Comment and default; an empty default is left out if the comment says what happens by default."""
    comment, default = comments.get(flag.name, ""), flag.default
    if default is dataclasses.MISSING:
        return f"{comment} (required)"
    if default in (None, "", ()):
        return comment if "by default" in comment.lower() else f"{comment} (default: none)"
    text = ",".join(map(str, default)) if isinstance(default, tuple) else str(default)
    return f"{comment} (default: {text.lower() if isinstance(default, bool) else text})"


def _assignments(words: Sequence[str], flags: Mapping[str, Flag]) -> Iterator[tuple[str, str]]:
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if not word.startswith("--"):
            raise BadCommandLine(f"{shown(word)} is not a flag; flags are written --name=value.")
        name, equals, value = word.removeprefix("--").partition("=")
        if name not in flags:
            valid = [f"--{each}" for each in flags]
            guess = did_you_mean(f"--{name}", valid)
            raise BadCommandLine(
                f"unknown flag {plain(f'--{name}')}.{guess} Valid flags: {', '.join(valid) or 'none'}."
            )
        if not equals:
            if rest and not rest[0].startswith("--"):
                value = rest.pop(0)
            elif flags[name].kind is bool:
                value = "true"
            else:
                raise BadCommandLine(f"flag --{name} needs a value, --{name}=...")
        yield name, value


def _decode(text: str, flag: Flag) -> Any:
    """The value of a flag from its text."""
    import draccus

    if flag.optional and text in ("null", ""):
        return None
    value: Any = text
    if flag.is_list:
        items = text.removeprefix("[").removesuffix("]").split(",")
        value = [item.strip() for item in items if item.strip()]
    try:
        return draccus.decode(flag.kind, value)
    except Exception as error:  # draccus lets through what a type's constructor raises
        choices = typing.get_args(flag.kind)
        if typing.get_origin(flag.kind) is Literal:
            problem = str(InvalidChoice(f"--{flag.name}", value, map(str, choices)))
        else:
            kind = choices[0] if flag.is_list else flag.kind
            meaning = MEANINGS.get(kind, flag.value_name)
            problem = f"--{flag.name} is {shown(value)}, but must be {meaning}"
        raise BadCommandLine(problem) from error


def _without_none(annotation: Any) -> tuple[Any, bool]:
    """(`X`, True) for `X | None`; (the annotation, False) for any other."""
    if typing.get_origin(annotation) not in (typing.Union, types.UnionType):
        return annotation, False
    options = [option for option in typing.get_args(annotation) if option is not type(None)]
    optional = len(options) < len(typing.get_args(annotation))
    return (options[0] if len(options) == 1 else annotation), optional
