"""Configuration of a benchmark: converts flags to complete settings, and settings back to the shortest flags."""

import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from lerobot_bimanual.benchmark.recipes import SIZES, SUFFIX, Recipe, option_text, option_value, sizes
from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.perturbation_levels import levels_text, parse_levels
from lerobot_bimanual.results.benchmark import INCIDENTAL, BenchmarkSettings
from lerobot_bimanual.results.protocols import OWN, PROTOCOLS, RULES, protocol_of

OWN_FLAGS = {
    "train_flags": (
        *("dataset.repo_id", "dataset.root", "dataset.episodes"),
        *("policy.type", "policy.path", "policy.device"),
        *("steps", "batch_size", "save_freq", "seed", "output_dir", "resume", "config_path"),
    ),
    "eval_flags": (
        *("policy.path", "policy.device", "eval.n_episodes", "seed", "output_dir", "config_path"),
        *("env.type", "env.task", "env.variation", "env.split", "env.setting", "env.perturb"),
        *("env.image_size", "env.results_dir", "env.video_dir"),
    ),
}
"""Flags that the benchmark sets from its own, which these flags therefore cannot hold."""
NOT_IN_RECIPES = ("dataset.episodes", "policy.path", "resume", "config_path")
"""The training flags above that a recipe cannot set; the benchmark overrides the others, except the seed."""
NUMBERS = ("demos", "image_size", "steps", "batch_size", "save_freq", "val_episodes", "test_episodes")
"""Fields that a recipe and a protocol fill in."""


@dataclass
class BenchmarkConfig:
    """Flags of the command `policy benchmark`."""

    policy: str = "peract2"  # types of policies, as for lerobot-train, separated by commas
    task: str = "lift_ball"  # tasks and suites, separated by commas; `lerobot-bimanual task list` lists them
    # `standard`, `few`, `plans`, `varied`, `hard`, `pairings` or `multitask`: fixes the training data and the
    # test, which other flags then cannot change. With `own` the flags decide.
    protocol: str = OWN
    variation: str | None = None  # index, or `any` for one that each seed draws; by default any
    # Tasks and suites, including `task`, from whose demonstrations one network learns. The benchmarks of
    # these tasks share it, and its last checkpoint is scored. By default it learns from `task` alone.
    trained_on: str | None = None
    # `small` or `paper`, for the training and for images and episodes; or a file for `lerobot-train`,
    # FILE.yaml, for any policy that LeRobot knows, with images and episodes as in `small`.
    recipe: str = "small"
    demos: int | None = None  # demonstrations; by default 100
    image_size: int | None = None  # side in pixels; by default 128 (small) or 256 (paper)
    steps: int | None = None  # optimiser steps; by default the recipe's
    batch_size: int | None = None  # rows of the dataset per step; by default the recipe's
    save_freq: int | None = None  # steps between checkpoints; by default the recipe's
    # Validation episodes per checkpoint, to test the best one; by default 100 (paper), or 0 (small) to test
    # the last one.
    val_episodes: int | None = None
    test_episodes: int | None = None  # of the tested checkpoint; by default 50 (small) or 100 (paper)
    seed: int = 1000  # of the training
    # Perturbations of the test and its baselines, and of nothing else: AXIS:LEVEL, several separated by commas; by default none.
    perturb: str | None = None
    # Of demonstrations, evaluations and baselines; by default standard.
    setting: Literal["standard", "varied"] | None = None
    demos_perturb: str | None = None  # perturbations of the demonstrations, likewise; by default none
    # `several`: demonstrations of the same scenes by each of the task's plans; see `dataset generate`. By default one.
    demos_plans: Literal["one", "several"] | None = None
    # Variations of the demonstrations, separated by commas; if set, the last checkpoint is scored. By default
    # that of the test.
    demos_variation: str | None = None
    # First seed of each task's demonstrations, so that trainings may differ in them, too.
    first_demo_seed: int = 0
    # First seed of the episodes; each split has other episodes for the same seeds. By default 0.
    first_seed: int | None = None
    # Further flags of the training, in one text; they win over the recipe's.
    train_flags: str = ""
    eval_flags: str = ""  # further flags of lerobot-eval, in one text
    video_dir: Path | None = None  # folder for a video of every evaluated episode; by default none is made
    device: str | None = None  # cpu, cuda, ...; by default LeRobot chooses
    workers: int = 0  # processes for generation and for expert and baseline; 0 takes one per core
    lanes: int = 1  # number of tasks that are worked on at the same time
    output: Path = Path("outputs/benchmark")  # policies of a task share its dataset and baselines here
    dry_run: bool = False  # print the commands and run nothing


def resolve(config: BenchmarkConfig) -> BenchmarkSettings:
    """Fill in recipe and protocol.

    Raises:
        BimanualError: a flag is outside its choices or contradicts the protocol, policy or recipe is not installed, or further
            flags are not allowed.
    """
    flags = _by_protocol(config)
    if flags["trained_on"]:
        _check_several(flags)
    if flags["trained_on"] or flags["demos_variation"]:
        if config.val_episodes:
            raise BimanualError(
                f"val_episodes is {config.val_episodes}, but a network that learned from other tasks or variations than it is "
                "tested on is scored by its last checkpoint: leave --val_episodes out"
            )
        config = replace(config, val_episodes=0)
    if config.recipe not in SIZES and not config.recipe.endswith(SUFFIX):
        raise InvalidChoice("recipe", config.recipe, [*SIZES, f"FILE{SUFFIX}"])
    name = Path(config.recipe).name.removesuffix(SUFFIX)
    if name in SIZES and name != config.recipe:
        raise BimanualError(
            f"{config.recipe} has the name of an installed recipe, and results would not tell them apart: rename it"
        )
    recipe = Recipe.find(config.policy, config.recipe)
    usual = vars(sizes(config.recipe)) | vars(recipe)
    protocol = protocol_of(flags | {"task": config.task, "evaluation": _options(config, "eval_flags")})
    usual |= {name: usual[name] * PROTOCOLS[protocol].rounds for name in ("steps", "save_freq")}
    given = {name: flags.pop(name, getattr(config, name)) for name in NUMBERS}
    numbers = {name: usual[name] if number is None else number for name, number in given.items()}
    training = recipe.options(numbers["image_size"])
    usual_device = training.get("policy.device")
    overlooked = {*NOT_IN_RECIPES} & training.keys()
    if training.get("seed", config.seed) != config.seed:
        overlooked.add("seed")
    if overlooked:
        raise BimanualError(
            f"{recipe.file} sets {', '.join(sorted(overlooked))}, which a benchmark sets itself: leave it out; it has "
            "--seed, --demos for fewer demonstrations, and policy.pretrained_path in the file for weights to start from"
        )
    training = {name: value for name, value in training.items() if name not in OWN_FLAGS["train_flags"]}
    # The dataset is in memory, so workers would have nothing to do.
    training |= {"num_workers": 0, "log_freq": max(1, numbers["save_freq"] // 5)}
    training |= _options(config, "train_flags")
    if numbers["val_episodes"] and "keep_last" in training:
        raise BimanualError(
            "train_flags hold --keep_last, but every checkpoint is validated: leave it out, or set --val_episodes=0"
        )
    return BenchmarkSettings.of(
        policy=config.policy,
        task=config.task,
        recipe=name,
        **numbers,
        **flags,
        seed=config.seed,
        first_demo_seed=config.first_demo_seed,
        device=config.device or usual_device,
        training=training,
        evaluation=_options(config, "eval_flags"),
    )


def shortest_config(settings: BenchmarkSettings) -> BenchmarkConfig:
    """Flags that resolve to these settings, without the values that recipe and protocol have today.

    Raises:
        BimanualError: policy or recipe is not installed, or the recipe now sets an option without which the policy was
            trained.
    """
    copied = settings.model_dump(include={field.name for field in fields(BenchmarkConfig)})
    fixed = PROTOCOLS[settings.protocol].flags(settings.task)
    copied |= {name: None for name, value in fixed.items() if copied[name] == value}
    if settings.trained_on or settings.demos_variation:
        copied["val_episodes"] = None  # its last checkpoint is scored
    usual = resolve(replace(BenchmarkConfig(**copied), **dict.fromkeys(NUMBERS)))
    copied |= {name: None for name in NUMBERS if copied[name] == getattr(usual, name)}
    today = resolve(BenchmarkConfig(**copied)).training  # it depends on these numbers, too
    if unset := today.keys() - settings.training.keys() - {*INCIDENTAL}:
        raise BimanualError(
            f"the recipe {settings.recipe!r} of {settings.policy!r} now sets {', '.join(sorted(unset))}, without which the "
            f"policy of {settings.task!r} was trained: add its value to `training` in the result, or train anew"
        )
    differing = {
        name: value
        for name, value in settings.training.items()
        if name not in INCIDENTAL and (name not in today or today[name] != value)
    }
    copied["train_flags"] = shlex.join(flag_words(differing))
    copied["eval_flags"] = shlex.join(flag_words(settings.evaluation))
    return BenchmarkConfig(**copied)


def flag_words(options: Mapping[str, Any]) -> list[str]:
    """`--name=value` for each option."""
    return [f"--{name}={option_text(value)}" for name, value in options.items()]


def command(config: BenchmarkConfig) -> str:
    """The command line of a benchmark, without the flags that have their defaults."""
    return " ".join(["lerobot-bimanual", "policy", "benchmark", *_words(config).values()])


def beyond_recipe(config: BenchmarkConfig) -> str:
    """Flags of `policy benchmark` that change how a policy is trained or scored, but for its seeds; "" if there are none."""
    named = ("policy", "task", "protocol", "variation", "recipe", "device", "seed", "first_demo_seed")
    return " ".join(word for name, word in _words(config).items() if name not in named)


def _by_protocol(config: BenchmarkConfig) -> dict[str, Any]:
    """The flags that protocols fix, in canonical form; a protocol other than `own` allows no other values."""
    task, name = config.task, config.protocol
    if not task.isidentifier():
        raise BimanualError(f"task is {task!r}, but a benchmark is of one task; run one per task")
    if name not in PROTOCOLS:
        raise InvalidChoice("protocol", name, PROTOCOLS)
    if task not in (tasks := PROTOCOLS[name].tasks or (task,)):
        raise InvalidChoice(f"task of the protocol {name}", task, tasks)
    fixed = PROTOCOLS[name].flags(task)
    flags = {
        each: value if (given := getattr(config, each)) is None else given for each, value in fixed.items()
    }
    if not re.fullmatch("any|[0-9]{1,4}", flags["variation"]):
        raise InvalidChoice("variation", flags["variation"], "an index of up to four digits, or any")
    flags["variation"] = re.sub("^0+(?=[0-9])", "", flags["variation"])
    flags |= {each: levels_text(parse_levels(flags[each], each)) for each in ("perturb", "demos_perturb")}
    flags["trained_on"] = "" if flags["trained_on"] == task else flags["trained_on"]
    for each, value in fixed.items():
        if name != OWN and flags[each] != value:
            raise BimanualError(
                f"{each} is {flags[each]!r}, but {value!r} in the protocol {name}: leave --{each} or --protocol out"
            )
    for rule in (f"env.{each}" for each in RULES):
        if name != OWN and rule in _options(config, "eval_flags"):
            raise BimanualError(
                f"--eval_flags sets --{rule}, which the protocol {name} leaves at its default: leave it or --protocol out"
            )
    return flags


def _check_several(flags: Mapping[str, Any]) -> None:
    """Refuse what a network for several tasks excludes."""
    trained_on = flags["trained_on"]
    if not all(name.isidentifier() for name in trained_on.split(",")):
        raise InvalidChoice("trained_on", trained_on, "tasks and suites, separated by commas")
    for name, usual in (("variation", "any"), ("demos_variation", "")):
        if flags[name] != usual:
            raise BimanualError(
                f"{name} is {flags[name]}, but --trained_on={trained_on} has demonstrations of any variation: "
                f"leave --{name} out"
            )


def _options(config: BenchmarkConfig, flag: str) -> dict[str, Any]:
    """Options in the text of one flag, by name; what the benchmark sets itself is refused."""
    text = getattr(config, flag)
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise BimanualError(f"--{flag} is {text!r}, which a shell could not read: {error}") from error
    options: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.removeprefix("--").partition("=")
        if not (word.startswith("--") and equals):
            raise BimanualError(f"--{flag} holds {word!r}, but must hold flags of the form --name=value")
        if name in OWN_FLAGS[flag]:
            raise BimanualError(f"--{flag} sets --{name}, which the benchmark sets itself from its own flags")
        options[name] = option_value(value)
    return options


def _words(config: BenchmarkConfig) -> dict[str, str]:
    """`--name=value` by name, for a shell, of the flags that name a result or do not have their defaults."""
    return {
        field.name: shlex.quote(f"--{field.name}={getattr(config, field.name)}")
        for field in fields(config)
        if field.name in ("policy", "task", "recipe") or getattr(config, field.name) != field.default
    }
