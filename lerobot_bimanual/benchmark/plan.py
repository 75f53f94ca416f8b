"""Flags, folders and commands of a benchmark."""

import os
import shlex
from collections.abc import Collection
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal, Self

from lerobot_bimanual.benchmark.pipeline import Stage, flag_words
from lerobot_bimanual.benchmark.recipe import (
    PolicyName,
    Recipe,
    RecipeName,
    cameras_of,
    input_flags,
    recipe_for,
    view_of,
)
from lerobot_bimanual.errors import BimanualError

EvaluationSplit = Literal["val", "test"]

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
    "env.image_size",
    "eval.n_episodes",
    "seed",
    "output_dir",
    "config_path",
)
"""Flags that the benchmark sets from its own, which `--train_flags` and `--eval_flags` therefore cannot hold."""


@dataclass
class BenchmarkConfig:
    """Flags of the `benchmark` verb."""

    # Type of the policy, as for lerobot-train.
    policy: PolicyName = "peract2"
    task: str = "lift_ball"  # one registered task
    variation: str = "any"  # index, or any
    recipe: RecipeName = "small"  # defaults of the numbers below, and the size of the network
    demos: int | None = None  # demonstrations; by default 100
    image_size: int | None = None  # side in pixels; by default 128 (small) or 256 (paper)
    steps: int | None = None  # optimiser steps; by default up to 3000 (small) or 100000 (paper)
    batch_size: int | None = None  # rows of the dataset per step; by default 8
    save_freq: int | None = None  # steps between checkpoints; by default half of them, or 10000 (paper)
    val_episodes: int | None = None  # per checkpoint; by default 20 (small) or 100 (paper)
    test_episodes: int | None = None  # of the best checkpoint; by default 50 (small) or 100 (paper)
    seed: int = 1000  # of the training
    first_seed: int = 0  # of the episodes; the splits give other episodes for the same seeds
    # Further flags of lerobot-train, in one text; they win over the recipe's.
    train_flags: str = ""
    eval_flags: str = ""  # further flags of lerobot-eval, in one text
    device: str | None = None  # cpu, cuda, ...; by default LeRobot chooses
    workers: int = 0  # processes for generation and certification; 0 takes one per core
    output: Path = Path("outputs/benchmark")  # policies of a task share its dataset and controls here
    dry_run: bool = False  # print the commands and run nothing


@dataclass(frozen=True)
class Plan:
    """Folders and commands of one benchmark.

    Attributes:
        config: What was asked for.
        recipe: Its numbers, none left open.
        more_training: Flags of `--train_flags`, by name.
        more_evaluation: Flags of `--eval_flags`, by name.
    """

    config: BenchmarkConfig
    recipe: Recipe
    more_training: dict[str, str]
    more_evaluation: dict[str, str]

    @classmethod
    def of(cls, config: BenchmarkConfig) -> Self:
        """Fill in the recipe.

        Raises:
            BimanualError: Several tasks, a number below 1, or further flags that are not allowed.
        """
        if "," in config.task:
            raise BimanualError(f"task is {config.task!r}, but a benchmark is of one task; run one per task")
        numbers = {field.name: getattr(config, field.name, None) for field in fields(Recipe)}
        given = {name: number for name, number in numbers.items() if number is not None}
        for name, number in given.items():
            if number < 1:
                raise BimanualError(f"{name} is {number}, but must be at least 1")
        return cls(
            config,
            replace(recipe_for(config.policy, config.recipe, config.task), **given),
            further_flags("train_flags", config.train_flags, OWN_TRAINING_FLAGS),
            further_flags("eval_flags", config.eval_flags, OWN_EVALUATION_FLAGS),
        )

    @property
    def folder(self) -> Path:
        """What the policies of a task share."""
        task, variation = self.config.task, self.config.variation
        return self.config.output.resolve() / (task if variation == "any" else f"{task}_{variation}")

    @property
    def dataset(self) -> Path:
        """The demonstrations."""
        return self.folder / f"{view_of(self.config.policy)}_{self.recipe.image_size}_{self.recipe.demos}"

    @property
    def run_folder(self) -> Path:
        """Training and evaluations."""
        return self.folder / f"{self.config.policy}_{self.config.recipe}_seed{self.config.seed}"

    @property
    def result(self) -> Path:
        """The result's file."""
        return self.folder.parent / "results" / f"{self.folder.name}_{self.run_folder.name}.json"

    def certificate(self, control: str) -> Path:
        """The result of the expert or a control on the test seeds."""
        return self.folder / f"{control}_{self._test_seeds.replace(':', '_')}.json"

    def checkpoint(self, step: int) -> Path:
        """The policy after so many steps."""
        digits = max(6, len(str(self.recipe.steps)))  # as LeRobot writes them
        return self.run_folder / "train" / "checkpoints" / f"{step:0{digits}d}" / "pretrained_model"

    def weights(self, step: int) -> Path:
        """The weights of the policy after so many steps."""
        return self.checkpoint(step) / "model.safetensors"

    def evaluation_file(self, split: EvaluationSplit, step: int) -> Path:
        """What `lerobot-eval` finds out about a checkpoint."""
        return self.run_folder / f"{split}_{self.checkpoint(step).parent.name}" / "eval_info.json"

    def generation(self) -> Stage:
        """Record the demonstrations; none of their seeds is in the splits of the evaluation."""
        flags = {
            "task": self.config.task,
            "variation": self.config.variation,
            "episodes": self.recipe.demos,
            "split": "train",
            "view": view_of(self.config.policy),
            "image_size": self.recipe.image_size,
            "cameras": ",".join(cameras_of(self.config.policy)),
            **({"intermediate": "0.35,0.7"} if view_of(self.config.policy) == "keyframes" else {}),
            "root": self.dataset,
            "repo_id": self._repo_id,
            "workers": self.config.workers,
        }
        words = ["lerobot-bimanual", "generate", *flag_words(flags)]
        return Stage(f"generate_{self.dataset.name}", words, output=self.dataset)

    def certification(self, control: str) -> Stage:
        """Score the expert or a control on the test seeds."""
        output = self.certificate(control)
        flags = {
            "task": self.config.task,
            "variation": self.config.variation,
            "split": "test",
            "seeds": self._test_seeds,
            "control": control,
            "workers": self.config.workers,
            "output": output,
        }
        words = ["lerobot-bimanual", "certify", *flag_words(flags)]
        return Stage(output.stem, words, output=output, judges=True)

    def training_flags(self) -> dict[str, str]:
        """Flags of `lerobot-train`, by name."""
        policy = dict(self.recipe.flags) | input_flags(self.config.policy, self.recipe.image_size)
        flags = {
            "dataset.repo_id": self._repo_id,
            "dataset.root": self.dataset,
            "policy.type": self.config.policy,
            **{f"policy.{name}": value for name, value in policy.items()},
            **self._device,
            "policy.push_to_hub": "false",
            "steps": self.recipe.steps,
            "batch_size": self.recipe.batch_size,
            # A worker process per core beyond the one that trains; LeRobot's own default is four.
            "num_workers": 0 if self._resident else min(4, max(1, (os.cpu_count() or 1) - 1)),
            "log_freq": max(1, self.recipe.save_freq // 5),
            "save_freq": self.recipe.save_freq,
            "seed": self.config.seed,
            "wandb.enable": "false",
            "output_dir": self.run_folder / "train",
            **self.more_training,
        }
        return {name: str(value) for name, value in flags.items()}

    def training(self) -> Stage:
        """Train with a checkpoint every `save_freq` steps."""
        return Stage(
            "train",
            [
                "lerobot-bimanual-train" if self._resident else "lerobot-train",
                *flag_words(self.training_flags()),
            ],
            output=self.checkpoint(self.recipe.steps),
            training_folder=self.run_folder / "train",
        )

    def evaluation(self, split: EvaluationSplit, step: int) -> Stage:
        """Score one checkpoint."""
        evaluation = self.evaluation_file(split, step)
        flags = {
            "policy.path": self.checkpoint(step),
            **self._device,
            "env.type": "bimanual",
            "env.task": self.config.task,
            "env.variation": self.config.variation,
            "env.split": split,
            "env.image_size": self.recipe.image_size,
            "env.cameras": ",".join(cameras_of(self.config.policy)),
            "eval.n_episodes": self.recipe.val_episodes if split == "val" else self.recipe.test_episodes,
            "eval.batch_size": 2,
            "seed": self.config.first_seed,
            "output_dir": evaluation.parent,
            **self.more_evaluation,
        }
        words = ["lerobot-eval", *flag_words(flags)]
        return Stage(evaluation.parent.name, words, output=evaluation, inputs=(self.weights(step),))

    @property
    def _resident(self) -> bool:
        """Whether the dataset fits into memory: keyframes do, all frames do not."""
        return view_of(self.config.policy) == "keyframes"

    @property
    def _device(self) -> dict[str, str]:
        return {} if self.config.device is None else {"policy.device": self.config.device}

    @property
    def _repo_id(self) -> str:
        return f"benchmark/{self.folder.name}"

    @property
    def _test_seeds(self) -> str:
        return f"{self.config.first_seed}:{self.config.first_seed + self.recipe.test_episodes}"


def further_flags(option: str, text: str, own: Collection[str]) -> dict[str, str]:
    """Flags in the text of one option, by name.

    Raises:
        BimanualError: The text is not a list of `--name=value`, or sets what the benchmark sets itself.
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
