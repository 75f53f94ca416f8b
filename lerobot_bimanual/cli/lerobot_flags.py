"""The flags of LeRobot's programs, read from the sources of its configs: importing LeRobot takes up to half a minute.

What the sources do not say is let through, and LeRobot decides.
"""

import ast
import pkgutil
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

from lerobot_bimanual.cli.flags import BadCommandLine
from lerobot_bimanual.distributions import location
from lerobot_bimanual.errors import InvalidChoice, did_you_mean, plain
from lerobot_bimanual.files import read_json, read_yaml

ALWAYS = ("config_path", "help", "trust_checkpoint")
OF_CHOICES = ("type", "path", "discover_packages_path")
"""Flags of every config that has several kinds, such as `--policy.type`."""
FAMILIES = {
    "PreTrainedConfig": ("lerobot.policies", "lerobot_policy_"),
    "EnvConfig": ("lerobot.envs", "lerobot_env_"),
}
"""Base of several kinds of configs -> LeRobot's package of them, and how the names of other packages of them begin."""
WITHOUT_FIELDS = ("draccus.ChoiceRegistry", "HubMixin", "abc.ABC")
KIND = re.compile(r"register_subclass\(\s*(?:name=)?\"(\w+)\".*?^class (\w+)", re.DOTALL | re.MULTILINE)
CLASS_NAME = re.compile(r"[A-Za-z_][\w.]*")

type Source = tuple[str, ast.ClassDef]
"""A module, and a class in its source."""


def check_flags(words: Sequence[str], module: str, name: str) -> dict[str, str]:
    """The values of flags by name, if a program of LeRobot knows them all; with kinds and paths that its config file names.

    Args:
        words: of the command line, after the program.
        module: where the class of the program's config is found.
        name: of that class.

    Raises:
        BadCommandLine: a flag is unknown.
        InvalidChoice: there is no such kind of policy or environment.
        BimanualError: its config file cannot be read.
    """
    given = dict(_assignments(words))
    values = _of_file(given.get("config_path", "")) | given
    known = {*ALWAYS, *_flags(_find(module, name), "", values)}
    unchecked = tuple(flag for flag in known if flag.endswith(".") or not flag)
    for flag in given:
        if flag not in known and not flag.startswith(unchecked):
            guess = did_you_mean(f"--{flag}", [f"--{each}" for each in sorted(known)])
            raise BadCommandLine(
                f"unknown flag --{plain(flag)}.{guess} `--help` lists the flags, after LeRobot's import."
            )
    return values


def _assignments(words: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Name and value of each flag; a value may be a word of its own."""
    for word, following in zip(words, [*words[1:], "--"], strict=True):
        if word.startswith("--") or word == "-h":
            name, equals, value = word.lstrip("-").partition("=")
            alone = "" if following.startswith("--") else following
            yield ("help" if name == "h" else name), value if equals else alone


def _of_file(place: str) -> dict[str, str]:
    """Kinds and paths that a config file names; a name on the Hub is LeRobot's matter."""
    path = Path(place)
    if path.suffix not in (".yaml", ".yml", ".json"):
        return {}
    content = read_yaml(path)
    sections = content if isinstance(content, dict) else {}
    return {
        f"{name}.{key}": str(part[key])
        for name, part in sections.items()
        for key in OF_CHOICES
        if isinstance(part, dict) and part.get(key)
    }


def _flags(source: Source | None, prefix: str, values: Mapping[str, str]) -> Iterator[str]:
    """Yield the flags of a class and of the classes of its fields; a prefix alone where its flags are not known."""
    fields = _fields(source)
    if fields is None:
        yield prefix
        return
    for name, (module, annotation) in fields.items():
        yield (flag := prefix + name)
        for inner in filter(None, (_find(module, each) for each in CLASS_NAME.findall(annotation))):
            if "ChoiceRegistry" in ast.unparse(inner[1]):
                yield from (f"{flag}.{each}" for each in OF_CHOICES)
                inner = _chosen(inner[1].name, flag, values)
            yield from _flags(inner, f"{flag}.", values)


def _chosen(family: str, flag: str, values: Mapping[str, str]) -> Source | None:
    """The config of the kind that a command line chooses; None where it is not known here."""
    kind, path = values.get(f"{flag}.type"), values.get(f"{flag}.path")
    if path is not None:
        config = Path(path) / "config.json"
        content = read_json(config) if config.is_file() else {}
        kind = content.get("type") if isinstance(content, dict) else None
    if kind is None or family not in FAMILIES or f"{flag}.discover_packages_path" in values:
        return None
    kinds = _kinds(*FAMILIES[family])
    if str(kind) not in kinds:
        raise InvalidChoice(f"--{flag}.type", kind, sorted(kinds))
    return _find(*kinds[str(kind)])


@cache
def _kinds(package: str, beginning: str) -> dict[str, tuple[str, str]]:
    """Kind -> module and class of its config, of LeRobot and of other installed packages."""
    found = {}
    for top in (package, *(each.name for each in pkgutil.iter_modules() if each.name.startswith(beginning))):
        if folder := location(top):
            for path in sorted([*folder.glob("*.py"), *folder.glob("*/configuration_*.py")]):
                module = ".".join((top, *path.relative_to(folder).with_suffix("").parts))
                found |= {
                    kind: (module, name) for kind, name in KIND.findall(path.read_text(encoding="utf-8"))
                }
    return found


def _fields(source: Source | None) -> dict[str, tuple[str, str]] | None:
    """Field -> module of its class and its annotation, those of base classes included; None if one of these is not found."""
    if source is None:
        return None
    module, node = source
    found: dict[str, tuple[str, str]] = {}
    for base in reversed([ast.unparse(each) for each in node.bases]):
        inherited = {} if base in WITHOUT_FIELDS else _fields(_find(module, base))
        if inherited is None:
            return None
        found |= inherited
    for each in node.body:
        if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name):
            found[each.target.id] = module, ast.unparse(each.annotation)
    return found


@cache
def _find(module: str, name: str) -> Source | None:
    """The class that a module knows by a name, wherever it is written; None if there is none."""
    tree, is_package = _tree(module)
    head, _, rest = name.partition(".")
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == name:
            return module, node
        if isinstance(node, ast.ImportFrom):
            parts = module.split(".")
            kept = len(parts) + is_package - node.level if node.level else 0
            origin = ".".join([*parts[:kept], *filter(None, [node.module])])
            for alias in node.names:
                if (alias.asname or alias.name) == head:
                    return _find(f"{origin}.{alias.name}", rest) if rest else _find(origin, alias.name)
    return None


@cache
def _tree(module: str) -> tuple[ast.Module, bool]:
    """The source of a module, and whether it is a package."""
    place = location(module)
    for path in (place / "__init__.py", place.with_suffix(".py")) if place else ():
        if path.is_file():
            return ast.parse(path.read_text(encoding="utf-8")), path.stem == "__init__"
    return ast.Module([], []), False
