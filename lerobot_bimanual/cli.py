"""`lerobot-bimanual <verb>`: the one command line of the project.

Core knows no verb but its own. Every installed distribution adds verbs through the entry-point group
`lerobot_bimanual.verbs`, so core never imports a plugin by name.

How to write a verb
    1. A function with one parameter, a dataclass, returning None or an exit code::

           @dataclass
           class GenerateConfig:
               task: str = "all"  # task names, comma separated, or a suite
               seeds: str = "0:100"  # half-open range a:b of the training split
               # A comment above the field is shown as well; use it for a text
               # that is longer than a line.
               output: Path = field(kw_only=True)  # new folder (no default: the flag is required)

           def generate(config: GenerateConfig) -> None:
               '''Record expert demonstrations as a LeRobot dataset.

               Further paragraphs, and a Google-style section of examples (whole command lines,
               one per line), are shown by `lerobot-bimanual generate --help`.
               '''

    2. An entry point of the distribution that owns it: `generate = "package.commands.generate:generate"`.
    3. Light at import: simulation and learning modules are imported inside the function, because
       `--help` imports the verb's module. The first docstring line is read from the source without
       importing anything, for the list of verbs.
    4. Failures that a user can cause are raised as `lerobot_bimanual.errors.BimanualError`: the command
       prints the message on one line and exits with 1. Set LEROBOT_BIMANUAL_TRACEBACK=1 to see the traceback.

`lerobot_bimanual.flags` says which flags a dataclass gets. Exit codes: 0 done (or what the verb returned),
1 the verb failed with a clear message, 2 the command line is wrong, 130 interrupted.
"""

import ast
import difflib
import importlib.util
import inspect
import os
import sys
import textwrap
import typing
from collections.abc import Callable, Iterable, Sequence
from dataclasses import is_dataclass
from importlib.metadata import EntryPoint, entry_points, version
from pathlib import Path

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.flag_help import describe_flags
from lerobot_bimanual.flags import BadCommandLine, parse_flags

PROGRAM = "lerobot-bimanual"
VERBS_GROUP = "lerobot_bimanual.verbs"
TRACEBACK_VARIABLE = "LEROBOT_BIMANUAL_TRACEBACK"
HELP_FLAGS = ("-h", "--help")


def main(words: Sequence[str] | None = None) -> int:
    """Run one verb.

    Args:
        words: Words after the program's name; those of the process when None.

    Returns:
        The exit code of the process (see the module's text).
    """
    try:
        code = _dispatch(list(sys.argv[1:] if words is None else words))
        sys.stdout.flush()
        return code
    except BimanualError as error:
        if os.environ.get(TRACEBACK_VARIABLE) == "1":
            raise
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2 if isinstance(error, BadCommandLine) else 1
    except KeyboardInterrupt:
        print(f"\n{PROGRAM}: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has left, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def find_verbs() -> dict[str, EntryPoint]:
    """All verbs of the installed distributions by name, sorted; none of their modules is imported."""
    return {
        entry.name: entry for entry in sorted(entry_points(group=VERBS_GROUP), key=lambda entry: entry.name)
    }


def summary(entry: EntryPoint) -> str:
    """First line of a verb's docstring, read from its source without importing it; "" if there is none."""
    top, *inner = entry.module.split(".")
    spec = importlib.util.find_spec(top)
    if spec is None or not spec.submodule_search_locations:
        return ""
    source = Path(spec.submodule_search_locations[0], *inner).with_suffix(".py")
    if not source.is_file():
        return ""
    for node in ast.parse(source.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef) and node.name == entry.attr:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""


def config_type_of(verb: Callable[..., int | None]) -> type:
    """The dataclass that a verb takes as its only parameter.

    Raises:
        TypeError: The function is not a verb: it takes another number of parameters, or no dataclass.
    """
    parameters = list(inspect.signature(verb).parameters)
    config_type = typing.get_type_hints(verb).get(parameters[0]) if len(parameters) == 1 else None
    if not (isinstance(config_type, type) and is_dataclass(config_type)):
        raise TypeError(f"verb {verb.__name__!r} must take exactly one parameter annotated with a dataclass")
    return config_type


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


if __name__ == "__main__":
    sys.exit(main())
