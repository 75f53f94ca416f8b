"""Command-line flags of a dataclass: draccus, LeRobot's own configuration library, with three traps removed.

Every field is a flag, `--name=value` or `--name value`; a field of a nested dataclass is `--outer.inner=value`;
`--config_path=file.yaml` reads values from a file, which flags override.

draccus reads values as YAML 1.1, which alters some texts in silence. Here instead
- a `str` or `Path` field takes its text as it stands (YAML reads `10:30` as the number 630 and `010` as 8);
- a `tuple` or `list` field takes a comma list, `--cameras=front,left_wrist` (draccus would split the text into
  letters);
- a `bool` field may stand alone, `--force` for `--force=true`.

Use `Literal["a", "b"]` for a choice, and `X | None = None` for what may be absent (`--name=null` sets None).
"""

import argparse
import dataclasses
import difflib
import json
import types
import typing
from collections.abc import Container, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.errors import BimanualError

CONFIG_FLAG = "config_path"


class BadCommandLine(BimanualError):
    """The user's command line cannot be understood; the message says what would be valid."""


@dataclasses.dataclass(frozen=True)
class Flag:
    """One field of a config as the command line sees it.

    Attributes:
        name: without dashes; dotted for a field of a nested dataclass.
        kind: the field's annotation without `| None`.
        optional: whether the annotation allows None.
        default: the default value; `dataclasses.MISSING` if the flag is required.
        owner: the dataclass that declares the field.
    """

    name: str
    kind: Any
    optional: bool
    default: Any
    owner: type

    @property
    def is_text(self) -> bool:
        """Whether the value is taken as it stands."""
        return self.kind in (str, Path)

    @property
    def is_list(self) -> bool:
        """Whether the value is a comma list."""
        return typing.get_origin(self.kind) in (tuple, list)

    @property
    def value_name(self) -> str:
        """What stands after the equals sign in a help text."""
        if typing.get_origin(self.kind) is Literal:
            return "|".join(str(choice) for choice in typing.get_args(self.kind))
        if self.is_list:
            return "a,b,..."
        names = {bool: "true|false", str: "text", Path: "path"}
        return names.get(self.kind) or getattr(self.kind, "__name__", str(self.kind))


def flags_of(config_type: type, prefix: str = "") -> Iterator[Flag]:
    """The flags of a dataclass in the order of its fields, nested dataclasses in place."""
    hints = typing.get_type_hints(config_type)
    for field in dataclasses.fields(config_type):
        name, annotation = prefix + field.name, hints[field.name]
        if isinstance(annotation, type) and dataclasses.is_dataclass(annotation):
            yield from flags_of(annotation, f"{name}.")
            continue
        factory = field.default_factory
        default = field.default if factory is dataclasses.MISSING else factory()
        kind, optional = _without_none(annotation)
        yield Flag(name, kind, optional, default, config_type)


def parse_flags[T](config_type: type[T], words: Sequence[str]) -> T:
    """Build a config from command-line words.

    Raises:
        BadCommandLine: a word is no flag, a flag is unknown, missing or lacks its value, or a value does not fit.
    """
    import draccus
    from draccus.utils import DraccusException

    flags = {flag.name: flag for flag in flags_of(config_type)}
    assignments = dict(_assignments(words, flags))
    arguments = [f"--{name}={value}" for name, value in assignments.items()]
    if CONFIG_FLAG not in assignments:  # whose file may give the rest
        _refuse_absence(flags.values(), assignments)
    try:
        return draccus.parse(config_type, args=arguments, exit_on_error=False)
    except (DraccusException, argparse.ArgumentError, OSError) as error:
        message = " ".join(str(error).split())
        raise BadCommandLine(f"{message}. Valid flags: {_listing(flags)}.") from error


def _assignments(words: Sequence[str], flags: dict[str, Flag]) -> Iterator[tuple[str, str]]:
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if not word.startswith("--"):
            raise BadCommandLine(f"{word!r} is no flag; flags are written --name=value.")
        name, equals, value = word.removeprefix("--").partition("=")
        flag = flags.get(name)
        if flag is None and name != CONFIG_FLAG:
            raise BadCommandLine(_unknown_flag(name, flags))
        if not equals:
            if rest and not rest[0].startswith("--"):
                value = rest.pop(0)
            elif flag is not None and flag.kind is bool:
                value = "true"
            else:
                raise BadCommandLine(f"flag --{name} needs a value, --{name}=...")
        yield name, value if flag is None else _as_yaml(value, flag)


def _refuse_absence(flags: Iterable[Flag], given: Container[str]) -> None:
    required = [flag for flag in flags if flag.default is dataclasses.MISSING]
    if missing := [f"--{flag.name}={flag.value_name}" for flag in required if flag.name not in given]:
        raise BadCommandLine(f"missing: {' '.join(missing)}. `--help` explains every flag.")


def _as_yaml(value: str, flag: Flag) -> str:
    """Quote texts so that YAML gives them back as they stand; other values are YAML already."""
    if flag.optional and value == "null":
        return value
    if flag.is_text:
        return json.dumps(value)
    if flag.is_list and not value.startswith("["):
        items = [item.strip() for item in value.split(",") if item.strip()]
        holds_text = str in typing.get_args(flag.kind)
        return f"[{', '.join(json.dumps(item) if holds_text else item for item in items)}]"
    return value


def _without_none(annotation: Any) -> tuple[Any, bool]:
    """(`X`, True) of `X | None`; (the annotation, False) of any other."""
    if typing.get_origin(annotation) not in (typing.Union, types.UnionType):
        return annotation, False
    options = [option for option in typing.get_args(annotation) if option is not type(None)]
    optional = len(options) < len(typing.get_args(annotation))
    return (options[0] if len(options) == 1 else annotation), optional


def _unknown_flag(name: str, flags: dict[str, Flag]) -> str:
    close = difflib.get_close_matches(name, flags, n=1)
    guess = f" Did you mean --{close[0]}?" if close else ""
    return f"unknown flag --{name}.{guess} Valid flags: {_listing(flags)}."


def _listing(flags: dict[str, Flag]) -> str:
    return ", ".join(f"--{name}" for name in flags)
