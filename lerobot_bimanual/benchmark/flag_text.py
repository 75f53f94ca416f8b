"""Flags of other commands, in one text: those that a benchmark passes on, and those of a recorded command."""

import shlex
from collections.abc import Collection

from lerobot_bimanual.errors import BimanualError

OWN_TRAINING_FLAGS = (
    "dataset.repo_id",
    "dataset.root",
    "policy.type",
    "policy.path",
    "steps",
    "batch_size",
    "save_freq",
    "seed",
    "output_dir",
    "resume",
    "config_path",
)
OWN_EVALUATION_FLAGS = (
    "policy.path",
    "env.type",
    "env.task",
    "env.variation",
    "env.split",
    "env.perturb",
    "env.image_size",
    "env.results_dir",
    "eval.n_episodes",
    "seed",
    "output_dir",
    "config_path",
)
"""Flags that the benchmark sets from its own, which `--train_flags` and `--eval_flags` therefore cannot hold."""


def further_flags(option: str, text: str, own: Collection[str]) -> dict[str, str]:
    """Flags in the text of one option, by name.

    Raises:
        BimanualError: the text is not a list of `--name=value`, or sets what the benchmark sets itself.
    """
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise BimanualError(f"--{option} is {text!r}, which no shell could read: {error}") from error
    flags: dict[str, str] = {}
    for word in words:
        name, equals, value = word.removeprefix("--").partition("=")
        if not (word.startswith("--") and equals):
            raise BimanualError(f"--{option} holds {word!r}, but must hold flags of the form --name=value")
        if name in own:
            raise BimanualError(
                f"--{option} sets --{name}, which the benchmark sets itself from its own flags"
            )
        flags[name] = value
    return flags


def command_flags(command: str) -> dict[str, str]:
    """Flags of a recorded command by name; none of what is no command."""
    try:
        words = shlex.split(command)
    except ValueError:
        return {}
    pairs = (word.removeprefix("--").partition("=") for word in words if word.startswith("--"))
    return {name: value for name, _, value in pairs}
