"""The commands that the installed distributions add to the command line, by group."""

import ast
import inspect
import typing
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from importlib.metadata import EntryPoint

from lerobot_bimanual.distributions import entries, location

ENTRY_POINTS = "lerobot_bimanual.commands"

SECTIONS = {
    "start": ("demo", "doctor", "task"),
    "data": ("dataset",),
    "train and score": ("expert", "policy"),
    "maintain": ("results",),
}
"""Sections of the overview, in order, with the groups and single commands that each lists."""


def find_commands() -> dict[str, EntryPoint]:
    """All commands by name ("dataset verify", "demo"), sorted; none of their modules is imported."""
    return entries(ENTRY_POINTS)


def leaves(group: str, names: typing.Iterable[str]) -> list[str]:
    """The second words of the commands of a group."""
    return [name.removeprefix(f"{group} ") for name in names if name.startswith(f"{group} ")]


def by_section(commands: Mapping[str, EntryPoint]) -> dict[str, list[str]]:
    """Names of the commands by section of the overview; those of other groups come last, under "more"."""
    order = {group: (section, i) for section, groups in SECTIONS.items() for i, group in enumerate(groups)}
    sections: dict[str, list[str]] = {section: [] for section in (*SECTIONS, "more")}
    for name in sorted(commands, key=lambda name: order.get(name.split()[0], ("more", 0))[1]):
        sections[order.get(name.split()[0], ("more", 0))[0]].append(name)
    return {section: names for section, names in sections.items() if names}


def summary(entry: EntryPoint) -> str:
    """First line of a command's docstring, read from its source without importing it; "" if there is none."""
    place = location(entry.module)
    source = place.with_suffix(".py") if place else None
    if source is None or not source.is_file():
        return ""
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name == entry.attr:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""


def config_type_of(command: Callable[..., int | None]) -> type:
    """The dataclass that a command takes as its only parameter.

    Raises:
        TypeError: the function is not a command: it takes another number of parameters, or no dataclass.
    """
    parameters = list(inspect.signature(command).parameters)
    config_type = typing.get_type_hints(command).get(parameters[0]) if len(parameters) == 1 else None
    if not (isinstance(config_type, type) and is_dataclass(config_type)):
        raise TypeError(
            f"command {command.__name__!r} must take exactly one parameter annotated with a dataclass"
        )
    return config_type
