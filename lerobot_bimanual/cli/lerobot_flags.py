"""Reads LeRobot's flags before LeRobot is imported, which takes up to half a minute; LeRobot checks them only then."""

import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

from lerobot_bimanual.files import read_yaml

TRUST_FLAG, KEEP_FLAG = "trust_checkpoint", "keep_last"
"""Flags that LeRobot does not know: whether to load a checkpoint without a check, and how many a training keeps."""


def program_name() -> str:
    """Name of this process's program as it is typed, such as `lerobot-eval`, also if Python runs its file."""
    return Path(sys.argv[0]).stem.replace("_", "-")


def flag_values(words: Sequence[str]) -> dict[str, str]:
    """The values of flags by name; kinds and paths that a config file names are among them.

    Raises:
        BimanualError: the config file cannot be read.
    """
    given = dict(_assignments(words))
    return _of_file(given.get("config_path", "")) | given


def strip_plugin_flags(words: Sequence[str]) -> list[str]:
    """The words of a command line for LeRobot: without our flags, and without values that follow them as separate words."""
    ours = (f"--{TRUST_FLAG}", f"--{KEEP_FLAG}")
    return [
        word
        for word, before in zip(words, ["", *words], strict=False)
        if word.partition("=")[0] not in ours and (word.startswith("--") or before not in ours)
    ]


def is_trusted(words: Sequence[str]) -> bool:
    """Whether a command line says to load what a checkpoint names without a check; the flag may be alone."""
    return dict(_assignments(words)).get(TRUST_FLAG, "false").lower() in ("", "true")


def _assignments(words: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Name and value of each flag; a value may be a word of its own."""
    for word, following in pairwise([*words, "--"]):
        if word.startswith("--") or word == "-h":
            name, equals, value = word.lstrip("-").partition("=")
            alone = "" if following.startswith("--") else following
            yield ("help" if name == "h" else name), value if equals else alone


def _of_file(place: str) -> dict[str, str]:
    """The entries `type` and `path` of a config file's sections, by flag; a config on the Hub is left to LeRobot."""
    path = Path(place)
    if path.suffix not in (".yaml", ".yml", ".json"):
        return {}
    content = read_yaml(path)
    sections = content if isinstance(content, dict) else {}
    return {
        f"{name}.{key}": str(part[key])
        for name, part in sections.items()
        for key in ("type", "path")
        if isinstance(part, dict) and part.get(key)
    }
