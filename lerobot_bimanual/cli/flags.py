"""Command-line flags of a dataclass, decoded by draccus, LeRobot's own configuration library, without its traps.

Every field is a flag, `--name=value` or `--name value`; a field of a nested dataclass is `--outer.inner=value`;
`--config_path=file.yaml` reads values from a file, which flags override.

draccus' own command line reads values as YAML 1.1, which alters some texts in silence, and takes a text that begins
with `include` for the name of a file to read. Here instead
- a `str` or `Path` field takes its text as it stands (YAML reads `10:30` as the number 630 and `010` as 8);
- a `tuple` or `list` field takes a comma list, `--cameras=front,left_wrist` (draccus would split the text into
  letters);
- a `bool` field may stand alone, `--force` for `--force=true`.

Use `Literal["a", "b"]` for a choice, and `X | None = None` for what may be absent (`--name=null` sets None).
"""

import dataclasses
import types
import typing
from collections.abc import Container, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Literal

import yaml

from lerobot_bimanual.errors import BimanualError, did_you_mean
from lerobot_bimanual.json_file import shown

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

    flags = {flag.name: flag for flag in flags_of(config_type)}
    assignments = dict(_assignments(words, flags))
    path = assignments.pop(CONFIG_FLAG, None)
    if path is None:  # whose file may give the rest
        _refuse_absence(flags.values(), assignments)
    values: dict[str, Any] = {} if path is None else _read_config(Path(path))
    for name, text in assignments.items():
        _put(values, name, _value(text, flags[name]))
    _refuse_nothing(values, flags.values())
    try:
        return draccus.decode(config_type, values)
    except Exception as error:  # draccus lets through whatever a type's constructor raises
        message = " ".join(str(error).split())
        raise BadCommandLine(message) from error


def _assignments(words: Sequence[str], flags: dict[str, Flag]) -> Iterator[tuple[str, str]]:
    rest = list(words)
    while rest:
        word = rest.pop(0)
        if not word.startswith("--"):
            raise BadCommandLine(f"{shown(word)} is no flag; flags are written --name=value.")
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
        yield name, value


def _refuse_absence(flags: Iterable[Flag], given: Container[str]) -> None:
    required = [flag for flag in flags if flag.default is dataclasses.MISSING]
    if missing := [f"--{flag.name}={flag.value_name}" for flag in required if flag.name not in given]:
        raise BadCommandLine(f"missing: {' '.join(missing)}. `--help` explains every flag.")


def _refuse_nothing(values: dict[str, Any], flags: Iterable[Flag]) -> None:
    """Of None, which YAML reads in `--seed=$UNSET`, draccus makes a value of any type."""
    for flag in flags:
        value: Any = values
        for key in flag.name.split("."):
            value = value.get(key, dataclasses.MISSING) if isinstance(value, dict) else dataclasses.MISSING
        if value is None and not flag.optional:
            raise BadCommandLine(f"--{flag.name} is empty or null, but must be {flag.value_name}")
        if isinstance(value, list) and None in value:
            raise BadCommandLine(f"--{flag.name} has an item that is empty or null")


def _read_config(path: Path) -> dict[str, Any]:
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())
        raise BadCommandLine(f"--{CONFIG_FLAG} {shown(str(path))} cannot be read: {reason}") from error
    if not isinstance(values, dict):
        raise BadCommandLine(
            f"--{CONFIG_FLAG}: {path} holds {shown(values)}, but must hold `name: value` lines"
        )
    return values


def _put(values: dict[str, Any], name: str, value: Any) -> None:
    """Set a value by its dotted name, over what a file has said."""
    *outer, last = name.split(".")
    for key in outer:
        inner = values.get(key)
        values[key] = values = inner if isinstance(inner, dict) else {}
    values[last] = value


def _value(text: str, flag: Flag) -> Any:
    """What a text says: itself, a comma list, or what YAML reads in it."""
    if flag.optional and text == "null":
        return None
    if flag.is_text:
        return text
    if flag.is_list and not text.startswith("["):
        items = [item.strip() for item in text.split(",") if item.strip()]
        return items if str in typing.get_args(flag.kind) else [_yaml(item, flag) for item in items]
    if typing.get_origin(flag.kind) is Literal:
        choices = {str(choice): choice for choice in typing.get_args(flag.kind)}
        if text not in choices:
            guess = did_you_mean(text, choices)
            raise BadCommandLine(
                f"--{flag.name} is {shown(text)}, but must be one of: {', '.join(choices)}{guess and '.'}{guess}"
            )
        return choices[text]
    return _number(text, flag) if flag.kind in (int, float) else _yaml(text, flag)


def _number(text: str, flag: Flag) -> float:
    try:
        return flag.kind(text)
    except ValueError as error:
        kind = "an integer" if flag.kind is int else "a number"
        raise BadCommandLine(f"--{flag.name} is {shown(text)}, but must be {kind}") from error


def _yaml(text: str, flag: Flag) -> Any:
    try:
        return yaml.safe_load(text)
    except (ValueError, RecursionError, yaml.YAMLError) as error:
        raise BadCommandLine(f"--{flag.name} is {shown(text)}, but must be {flag.value_name}") from error


def _without_none(annotation: Any) -> tuple[Any, bool]:
    """(`X`, True) of `X | None`; (the annotation, False) of any other."""
    if typing.get_origin(annotation) not in (typing.Union, types.UnionType):
        return annotation, False
    options = [option for option in typing.get_args(annotation) if option is not type(None)]
    optional = len(options) < len(typing.get_args(annotation))
    return (options[0] if len(options) == 1 else annotation), optional


def _unknown_flag(name: str, flags: dict[str, Flag]) -> str:
    names = [f"--{valid}" for valid in flags]
    typed = f"--{name}" if name.isprintable() else shown(f"--{name}")
    return f"unknown flag {typed}.{did_you_mean(typed, names)} Valid flags: {', '.join(names)}."
