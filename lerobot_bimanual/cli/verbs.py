"""The verbs that the installed distributions add to the command line."""

import ast
import inspect
import typing
from collections.abc import Callable
from dataclasses import is_dataclass
from importlib.metadata import EntryPoint

from lerobot_bimanual.distributions import entries, location

GROUP = "lerobot_bimanual.verbs"


def find_verbs() -> dict[str, EntryPoint]:
    """All verbs by name, sorted; none of their modules is imported."""
    return entries(GROUP)


def summary(entry: EntryPoint) -> str:
    """First line of a verb's docstring, read from its source without importing it; "" if there is none."""
    place = location(entry.module)
    source = place.with_suffix(".py") if place else None
    if source is None or not source.is_file():
        return ""
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name == entry.attr:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""


def config_type_of(verb: Callable[..., int | None]) -> type:
    """The dataclass that a verb takes as its only parameter.

    Raises:
        TypeError: the function is not a verb: it takes another number of parameters, or no dataclass.
    """
    parameters = list(inspect.signature(verb).parameters)
    config_type = typing.get_type_hints(verb).get(parameters[0]) if len(parameters) == 1 else None
    if not (isinstance(config_type, type) and is_dataclass(config_type)):
        raise TypeError(f"verb {verb.__name__!r} must take exactly one parameter annotated with a dataclass")
    return config_type
