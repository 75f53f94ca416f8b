"""From the words of a command line to a verb, its help or a message."""

import difflib
import inspect
import os
import signal
import sys
import textwrap
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import EntryPoint, version
from types import FrameType

from lerobot_bimanual.cli.flag_help import describe_flags
from lerobot_bimanual.cli.flags import BadCommandLine, parse_flags
from lerobot_bimanual.cli.verbs import config_type_of, find_verbs, summary
from lerobot_bimanual.errors import BimanualError

PROGRAM = "lerobot-bimanual"
TRACEBACK_VARIABLE = "LEROBOT_BIMANUAL_TRACEBACK"
HELP_FLAGS = ("-h", "--help")


def main(words: Sequence[str] | None = None) -> int:
    """Run one verb.

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


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let a termination unwind the verb, so that its workers end and its temporary files go; it is silent."""
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


def _dispatch(words: list[str]) -> int:
    verbs = find_verbs()
    if not words or words[0] in HELP_FLAGS:
        print(_overview(verbs))
        return 0
    name, *flags = words
    if name == "--version":
        print(f"{PROGRAM} {version('lerobot_bimanual')}")
        return 0
    if name not in verbs:
        raise BadCommandLine(_unknown_verb(name, verbs))
    verb = verbs[name].load()
    config_type = config_type_of(verb)
    if any(flag in HELP_FLAGS for flag in flags):
        print(_verb_help(name, inspect.getdoc(verb) or "", describe_flags(config_type)))
        return 0
    return verb(parse_flags(config_type, flags)) or 0


def _overview(verbs: dict[str, EntryPoint]) -> str:
    width = max(map(len, verbs), default=0) + 2
    listing = "\n".join(f"  {name:<{width}}{summary(entry)}" for name, entry in verbs.items())
    return (
        f"usage: {PROGRAM} <verb> [--flag=value ...]\n\nverbs:\n{listing}\n\n"
        f"`{PROGRAM} <verb> --help` lists a verb's flags. Training and evaluation are LeRobot's own:\n"
        "`lerobot-train --policy.type=peract2` and `lerobot-eval --env.type=bimanual`."
    )


def _unknown_verb(name: str, verbs: Iterable[str]) -> str:
    close = difflib.get_close_matches(name, list(verbs), n=1)
    guess = f" Did you mean {close[0]!r}?" if close else ""
    return f"unknown verb {name!r}.{guess} The installed verbs are: {', '.join(verbs)}."


def _verb_help(name: str, docstring: str, flags: str) -> str:
    text, _, examples = docstring.partition("\nExamples:\n")
    parts = [f"usage: {PROGRAM} {name} [--flag=value ...]", text.strip(), f"flags:\n{flags}"]
    if examples:
        parts.append("examples:\n" + textwrap.indent(inspect.cleandoc(examples), "  "))
    return "\n\n".join(parts)
