"""The flags of LeRobot's programs, read from the sources of its configs: importing LeRobot takes up to half a minute.

What the sources do not say is let through, and LeRobot decides.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

from lerobot_bimanual.cli.flags import BadCommandLine
from lerobot_bimanual.distributions import location
from lerobot_bimanual.errors import InvalidChoice, did_you_mean, plain
from lerobot_bimanual.files import read_json, read_yaml

TRUST_FLAG, KEEP_FLAG = "trust_checkpoint", "keep_last"
"""Flags that LeRobot does not know: load what a checkpoint names without a check; of a training, how many checkpoints are kept."""
ALWAYS = ("config_path", "help", TRUST_FLAG)
OF_CHOICES = ("type", "path", "discover_packages_path")
"""Flags of every config that has several kinds, such as `--policy.type`."""
SECTIONS = {"dataset": "DatasetConfig", "eval": "EvalConfig", "wandb": "WandBConfig"}
"""Prefix of flags -> class in LeRobot's configs whose fields they are."""
FAMILIES = {"policy": ("lerobot.policies", "lerobot_policy_"), "env": ("lerobot.envs", "lerobot_env_")}
"""Prefix of flags of a config that has several kinds -> LeRobot's package of them, and how the names of plugins begin."""
CLASS = re.compile(r"^class (\w+).*\n((?:(?: .*)?\n)*)", re.MULTILINE)
FIELD = re.compile(r"^    (\w+): ", re.MULTILINE)
KIND = re.compile(r"^@\w+\.register_subclass\(\s*(?:name=)?[\"']([^\"']+)", re.MULTILINE)


def check_flags(words: Sequence[str], config: str) -> dict[str, str]:
    """The values of flags by name, if a program of LeRobot with this class of config may know them.

    Kinds and paths that its config file names are among them. A policy's or environment's flags may be those of any kind.

    Raises:
        BadCommandLine: a flag is unknown.
        InvalidChoice: there is no such kind of policy or environment.
        BimanualError: its config file cannot be read.
    """
    given = dict(_assignments(words))
    values = _of_file(given.get("config_path", "")) | given
    known = {*_flags(config)}
    for family in FAMILIES:
        kind = _kind(family, values)
        if kind is None or f"{family}.discover_packages_path" in values:
            continue
        if kind not in (kinds := known_kinds(family)):
            raise InvalidChoice(f"--{family}.type", kind, sorted(kinds))
    for flag in given if known else ():
        section, _, rest = flag.partition(".")
        field = rest.partition(".")[0]
        is_checked = not rest or section in (*SECTIONS, *FAMILIES)
        if section not in known or (is_checked and field and f"{section}.{field}" not in known):
            guess = did_you_mean(f"--{flag}", [f"--{each}" for each in sorted(known)])
            raise BadCommandLine(
                f"unknown flag --{plain(flag)}.{guess} `--help` lists the flags, after LeRobot's import."
            )
    return values


def known_kinds(family: str) -> list[str]:
    """Names of the kinds of policies, or of environments, that are installed."""
    return KIND.findall(_text(family))


def without_ours(words: Sequence[str]) -> list[str]:
    """What LeRobot is given of a command line: our flags go, and values that follow them as words of their own."""
    ours = (f"--{TRUST_FLAG}", f"--{KEEP_FLAG}")
    return [
        word
        for word, before in zip(words, ["", *words], strict=False)
        if word.partition("=")[0] not in ours and (word.startswith("--") or before not in ours)
    ]


def is_trusted(words: Sequence[str]) -> bool:
    """Whether a command line says to load what a checkpoint names without a check; the flag may be alone."""
    return dict(_assignments(words)).get(TRUST_FLAG, "false").lower() in ("", "true")


def _kind(family: str, values: Mapping[str, str]) -> str | None:
    """The kind of policy or environment that a flag names, or a local checkpoint."""
    if path := values.get(f"{family}.path"):
        config = Path(path) / "config.json"
        content = read_json(config) if config.is_file() else None
        return str(content.get("type")) if isinstance(content, dict) else None
    return values.get(f"{family}.type")


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


def _flags(config: str) -> Iterator[str]:
    """Yield the flags of a program, without those of sections that LeRobot alone knows; none where it has renamed a config."""
    classes = {name: FIELD.findall(block) for name, block in CLASS.findall(_text("configs"))}
    if not {config, "PreTrainedConfig", *SECTIONS.values()} <= classes.keys():
        return
    yield from (*ALWAYS, *classes[config])
    if config == "TrainPipelineConfig":
        yield KEEP_FLAG
    for section, name in SECTIONS.items():
        yield from (f"{section}.{field}" for field in classes[name])
    yield from (f"policy.{field}" for field in classes["PreTrainedConfig"])
    for family in FAMILIES:
        yield from (f"{family}.{field}" for field in (*OF_CHOICES, *FIELD.findall(_text(family))))


@cache
def _text(family: str) -> str:
    """The sources of a family of configs, of LeRobot and of installed plugins; those of "configs" are LeRobot's others."""
    package, beginning = FAMILIES.get(family, ("lerobot.configs", "lerobot.configs"))
    plugins = {each.name for each in distributions() if (each.name or "").startswith(beginning)}
    folders = filter(None, map(location, (package, *plugins)))
    paths = [path for folder in folders for path in (*folder.glob("*.py"), *folder.glob("*/config*.py"))]
    return "".join(path.read_text(encoding="utf-8") for path in sorted(paths))
