"""Runs the command of an installed distribution that a command line names, or prints its help or an error."""

import ast
import inspect
import io
import os
import signal
import sys
import textwrap
import typing
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import EntryPoint, version
from pathlib import Path

from lerobot_bimanual.cli.flags import BadCommandLine, describe_flags, parse_flags
from lerobot_bimanual.distributions import entries, module_path, require_extras
from lerobot_bimanual.errors import MAX_MESSAGE, BimanualError, did_you_mean, plain
from lerobot_bimanual.interrupts import termination_as_system_exit

PROGRAM = "lerobot-bimanual"
ENTRY_POINTS = "lerobot_bimanual.commands"
TRACEBACK_VARIABLE = "LEROBOT_BIMANUAL_TRACEBACK"
HELP_FLAGS = ("-h", "--help")
SECTIONS = {
    **dict.fromkeys(("doctor", "task"), "start"),
    "dataset": "data",
    **dict.fromkeys(("expert", "policy"), "train and score"),
    "results": "maintain",
}
"""Section of the overview for each group or single command, in the order of the sections; others come last, under "more"."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the command of the words after the program's name, by default this process's; returns the exit code."""
    return run_reporting_errors(PROGRAM, lambda: _dispatch(list(sys.argv[1:] if words is None else words)))


def run_reporting_errors(program: str, work: Callable[[], int]) -> int:
    """The exit code of a program's work; if it fails, a line that begins with the program's name says why."""
    code = 128 + signal.SIGPIPE  # if the reader of our output leaves before the end, as `head` does
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the caller
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115  as long as this process
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal may know ASCII only
    try:
        with termination_as_system_exit():
            code = work()
        sys.stdout.flush()
        return code
    except BimanualError as error:
        if os.environ.get(TRACEBACK_VARIABLE) == "1":
            raise
        print(f"{program}: {plain(error, MAX_MESSAGE)}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt as interrupt:
        remark = f"; {interrupt}" if interrupt.args else ""
        print(f"\n{program}: interrupted{remark}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return code


def find_commands(group: str = "") -> dict[str, EntryPoint]:
    """All commands, or those of a group, by name ("dataset verify", "doctor"), sorted; none of their modules is imported."""
    found = entries(ENTRY_POINTS)
    return {name: entry for name, entry in found.items() if name.startswith(group and f"{group} ")}


def find_command(words: Sequence[str]) -> tuple[str, list[str]]:
    """The name of the command that words (at least one) begin with, and the words that follow it.

    Raises:
        BadCommandLine: no installed command has that name.
    """
    names = find_commands()
    for count in (1, 2):
        if (name := " ".join(words[:count])) in names:
            return name, [*words[count:]]
    members = find_commands(words[0])
    typed = words[:2] if members else words[:1]
    valid = [*members] or [*dict.fromkeys(name.split()[0] for name in names)]
    name = " ".join(typed)
    guess = did_you_mean(name, [*names, *valid])
    raise BadCommandLine(f"unknown command {name!r}.{guess} Commands: {', '.join(valid)}.")


def config_type_of(command: Callable[..., int | None]) -> type:
    """The dataclass that a command takes as its only parameter."""
    (parameter,) = inspect.signature(command).parameters
    return typing.get_type_hints(command)[parameter]


def summary(entry: EntryPoint) -> str:
    """First line of a command's docstring, read from its source without importing it; "" if there is none."""
    place = module_path(entry.module)
    source = place.with_suffix(".py") if place else None
    if source is None or not source.is_file():
        return ""
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name == entry.attr:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""


def _dispatch(words: list[str]) -> int:
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    if words == ["--version"]:
        print(f"{PROGRAM} {version('lerobot_bimanual')}")
        return 0
    group = " ".join(word for word in words if word not in HELP_FLAGS)
    if not group or find_commands(group):
        print(_overview(find_commands(group), group))
        return 0
    name, flags = find_command(words)
    entry = find_commands()[name]
    command = entry.load()
    config_type = config_type_of(command)
    if any(flag in HELP_FLAGS for flag in flags):
        print(_command_help(name, inspect.getdoc(command) or "", describe_flags(config_type)))
        return 0
    require_extras(entry)
    return command(parse_flags(config_type, flags)) or 0


def _overview(commands: Mapping[str, EntryPoint], group: str) -> str:
    """The commands of a group, or all, by section."""
    width = max(map(len, commands)) + 2
    sections: dict[str, str] = dict.fromkeys([*SECTIONS.values(), "more"], "")
    for name, entry in commands.items():
        sections[SECTIONS.get(name.split()[0], "more")] += f"\n  {name:<{width}}{summary(entry)}"
    listing = "\n\n".join(f"{section}:{lines}" for section, lines in sections.items() if lines)
    text = (
        f"usage: {' '.join([PROGRAM, *group.split()])} <command> [--flag=value ...]\n\n{listing}\n\n"
        f"`{PROGRAM} help <command>` lists a command's flags."
    )
    if group:
        return text
    return (
        f"{text} Training and evaluation are LeRobot's own:\n"
        "`lerobot-train --policy.type=peract2` and `lerobot-eval --env.type=bimanual`."
    )


def _command_help(name: str, docstring: str, flags: str) -> str:
    text, _, examples = docstring.partition("\nExamples:\n")
    parts = [f"usage: {PROGRAM} {name} [--flag=value ...]", text.strip(), f"flags:\n{flags}"]
    if examples:
        parts.append("examples:\n" + textwrap.indent(inspect.cleandoc(examples), "  "))
    return "\n\n".join(parts)
