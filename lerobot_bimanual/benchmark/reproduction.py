"""The command that trains a row of results again, and how far it departs from today's recipe of that name.

Rows hold every flag of their training, so they stay true when a recipe changes; what a recipe no longer says, the
command says itself. What a recipe did not say yet was the policy's default, which the command says, too.
"""

import shlex
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, replace
from importlib import import_module
from typing import Any, cast

import yaml

from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan
from lerobot_bimanual.benchmark.protocol import RecipeName
from lerobot_bimanual.benchmark.recipe import GROUP, flag_text
from lerobot_bimanual.benchmark.results import PLACES, ResultRow
from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError

INCIDENTAL = ("num_workers", "wandb.enable")
"""Training flags that decide nothing about what is learned: how many processes read, and whether a tracker watches."""


def config_of(row: ResultRow) -> BenchmarkConfig:
    """What is asked of a benchmark that trains a row again; what its recipe and protocol say anyway is left open.

    Raises:
        BimanualError: policy or recipe is not installed, or the recipe now sets what the row was trained without and
            the policy has no default of, so that no command gives it again.
    """
    asked = BenchmarkConfig(
        policy=row.policy,
        task=row.task,
        variation=row.variation,
        trained_on=row.trained_on,
        recipe=cast(RecipeName, row.recipe),  # another one is refused below
        demos=len(row.dataset.seeds),
        image_size=row.dataset.image_size,
        steps=int(row.flags["steps"]),
        batch_size=int(row.flags["batch_size"]),
        save_freq=int(row.flags["save_freq"]),
        val_episodes=_val_episodes(row),
        test_episodes=len(row.episodes),
        seed=int(row.flags["seed"]),
        perturb=row.evaluation.perturb,
        demos_perturb=row.demos_perturb,
        first_seed=min(episode.seed for episode in row.episodes),
        device=row.flags.get("policy.device"),
    )
    usual = Plan.of(BenchmarkConfig(policy=row.policy, recipe=asked.recipe))
    numbers = vars(usual.protocol) | vars(usual.recipe)
    said_anyway = {name: None for name, number in numbers.items() if getattr(asked, name, None) == number}
    config = replace(asked, **said_anyway, train_flags=_further_flags(row, Plan.of(asked).training_flags()))
    Plan.of(config)  # nobody is shown a command that would be refused
    return config


def _val_episodes(row: ResultRow) -> int | None:
    if row.trained_on:
        return None  # its last checkpoint is scored anyway
    return len(row.validation[0].episodes) if row.validation else 0


def _further_flags(row: ResultRow, today: Mapping[str, str]) -> str:
    """The training flags of a row that are others than today's, in one text."""
    unset = today.keys() - row.flags.keys() - {*PLACES, *INCIDENTAL}
    defaults = policy_defaults(row.policy) if unset else {}
    if unknown := unset - defaults.keys():
        raise BimanualError(
            f"the recipe {row.recipe!r} of {row.policy!r} now sets {', '.join(sorted(unknown))}, and the row of "
            f"{row.task!r} was trained without: train it anew, or leave it out"
        )
    others = [
        f"--{name}={value}"
        for name, value in (row.flags | {name: defaults[name] for name in sorted(unset)}).items()
        if name not in INCIDENTAL and (name not in today or flag_value(today[name]) != flag_value(value))
    ]
    return " ".join(word if _is_a_word(word) else shlex.quote(word) for word in others)


def policy_defaults(policy: str) -> dict[str, str]:
    """The default of each flag of a policy that has one, as a flag's text; none of a policy that is not found.

    Those of LeRobot are found, and those whose config lies beside their recipe, named as LeRobot asks of plugins.
    """
    from lerobot.configs.policies import PreTrainedConfig  # seconds, and few rows are older than their recipe

    beside_recipe = f"{entries(GROUP)[policy].value}.configuration_{policy}"
    for module in (beside_recipe, "lerobot.policies"):  # of LeRobot's all at once, which takes seconds more
        if policy not in PreTrainedConfig.get_known_choices():
            with suppress(ImportError):  # then it has no defaults here
                import_module(module)
    config = PreTrainedConfig.get_known_choices().get(policy)
    return {
        f"policy.{field.name}": flag_text(field.default)
        for field in (fields(config) if config else ())
        if field.init and isinstance(field.default, str | int | float | tuple | None)
    }


def _is_a_word(text: str) -> bool:
    """Whether a shell's words, without its expansions, are just this one."""
    try:
        return shlex.split(text) == [text]
    except ValueError:  # a quote that does not end
        return False


def beyond_recipe(config: BenchmarkConfig) -> str:
    """Flags of the verb `benchmark` that change what is trained or how it is scored; "" if there are none."""
    named = ("policy", "task", "variation", "recipe", "device")
    return " ".join(word for name, word in _words(config).items() if name not in named)


def command(config: BenchmarkConfig) -> str:
    """The command line of a benchmark, without the flags that have their defaults."""
    return " ".join(["lerobot-bimanual", "policy", "benchmark", *_words(config).values()])


def _words(config: BenchmarkConfig) -> dict[str, str]:
    """`--name=value` by name, for a shell, of the flags that do not have their defaults, and of what names a cell."""
    return {
        field.name: _quoted(field.name, str(getattr(config, field.name)))
        for field in fields(config)
        if field.name in ("policy", "task", "recipe") or getattr(config, field.name) != field.default
    }


def _quoted(name: str, value: str) -> str:
    """`--name=value` for a shell, if possible with the value in double quotes, which people can read."""
    word = f"--{name}={value}"
    if shlex.quote(word) == word or set(value) & set('"$`!\\'):
        return shlex.quote(word)
    return f'--{name}="{value}"'


def flag_value(text: str) -> Any:
    """What LeRobot reads from a flag: `2e-3` and `0.002` are one number. Of what nobody can read, the text itself."""
    try:
        value = yaml.safe_load(text)
    except Exception:  # YAML's readers of damaged values raise nearly anything
        return text
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value
