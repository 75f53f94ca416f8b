"""From the words of a command line to a command, its help or a message."""

import difflib
import inspect
import os
import shlex
import signal
import sys
import textwrap
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import EntryPoint, version
from types import FrameType

from lerobot_bimanual.cli.commands import by_section, config_type_of, find_commands, leaves, summary
from lerobot_bimanual.cli.flag_help import describe_flags
from lerobot_bimanual.cli.flags import BadCommandLine, parse_flags
from lerobot_bimanual.errors import BimanualError

PROGRAM = "lerobot-bimanual"
TRACEBACK_VARIABLE = "LEROBOT_BIMANUAL_TRACEBACK"
HELP_FLAGS = ("-h", "--help")


def main(words: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        words: words after the program's name; those of the process when None.

    Returns:
        The exit code of the process (see the package's text).
    """
    try:
        with _ended_in_order():
            code = _dispatch(list(sys.argv[1:] if words is None else words))
        sys.stdout.flush()
        return code
    except BimanualError as error:
        if os.environ.get(TRACEBACK_VARIABLE) == "1":
            raise
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2 if isinstance(error, BadCommandLine) else 1
    except KeyboardInterrupt as interrupt:
        remark = f"; {interrupt}" if interrupt.args else ""
        print(f"\n{PROGRAM}: interrupted{remark}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def show_next(*words: object) -> None:
    """Print the command that continues the work, as the last line of a command.

    It goes to stderr, because programs may read what a command prints.

    Args:
        words: words of the command, the program's name included.
    """
    print(f"next: {shlex.join(map(str, words))}", file=sys.stderr)


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let a termination unwind the command, so that its workers end and its temporary files go."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number: int, _: FrameType | None) -> None:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def find_command(words: Sequence[str]) -> tuple[str, list[str]]:
    """The name of the command that words begin with, and the words that follow it.

    Args:
        words: words after the program's name, at least one.

    Raises:
        BadCommandLine: no installed command has that name.
    """
    names = find_commands()
    first, *rest = words
    if first in names:
        return first, rest
    members = leaves(first, names)
    if not members:
        groups = dict.fromkeys(name.split()[0] for name in names)
        meant = {name.split()[-1]: name for name in names} | {group: group for group in groups}
        raise BadCommandLine(_unknown(first, first, meant, f"Commands: {', '.join(groups)}"))
    leaf = rest[0] if rest else ""
    if leaf not in members:
        meant = {member: f"{first} {member}" for member in members}
        raise BadCommandLine(
            _unknown(f"{first} {leaf}", leaf, meant, f"Commands of {first}: {', '.join(members)}")
        )
    return f"{first} {leaf}", rest[1:]


def _dispatch(words: list[str]) -> int:
    commands = find_commands()
    if words[:1] == ["help"]:
        words = [*words[1:], "--help"]
    if not words or words[0] in HELP_FLAGS:
        print(_overview(commands))
        return 0
    if words[0] == "--version":
        print(f"{PROGRAM} {version('lerobot_bimanual')}")
        return 0
    if leaves(words[0], commands) and (len(words) == 1 or words[1] in HELP_FLAGS):
        print(_group_help(words[0], commands))
        return 0
    name, flags = find_command(words)
    command = commands[name].load()
    config_type = config_type_of(command)
    if any(flag in HELP_FLAGS for flag in flags):
        print(_command_help(name, inspect.getdoc(command) or "", describe_flags(config_type)))
        return 0
    return command(parse_flags(config_type, flags)) or 0


def _overview(commands: Mapping[str, EntryPoint]) -> str:
    width = max(map(len, commands), default=0) + 2
    sections = "\n\n".join(
        f"{section}:\n{_listing({name: commands[name] for name in names}, width)}"
        for section, names in by_section(commands).items()
    )
    return (
        f"usage: {PROGRAM} <command> [--flag=value ...]\n\n{sections}\n\n"
        f"`{PROGRAM} help <command>` lists a command's flags. Training and evaluation are LeRobot's own:\n"
        "`lerobot-train --policy.type=peract2` and `lerobot-eval --env.type=bimanual`."
    )


def _group_help(group: str, commands: Mapping[str, EntryPoint]) -> str:
    members = {leaf: commands[f"{group} {leaf}"] for leaf in leaves(group, commands)}
    listing = _listing(members, max(map(len, members)) + 2)
    return (
        f"usage: {PROGRAM} {group} <command> [--flag=value ...]\n\n{listing}\n\n"
        f"`{PROGRAM} help {group} <command>` lists a command's flags."
    )


def _listing(commands: Mapping[str, EntryPoint], width: int) -> str:
    return "\n".join(f"  {name:<{width}}{summary(entry)}" for name, entry in commands.items())


def _unknown(typed: str, word: str, meant: Mapping[str, str], valid: str) -> str:
    close = difflib.get_close_matches(word, meant, n=1)
    guess = f" Did you mean {meant[close[0]]!r}?" if close else ""
    return f"unknown command {typed.strip()!r}.{guess} {valid}."


def _command_help(name: str, docstring: str, flags: str) -> str:
    text, _, examples = docstring.partition("\nExamples:\n")
    parts = [f"usage: {PROGRAM} {name} [--flag=value ...]", text.strip(), f"flags:\n{flags}"]
    if examples:
        parts.append("examples:\n" + textwrap.indent(inspect.cleandoc(examples), "  "))
    return "\n\n".join(parts)
