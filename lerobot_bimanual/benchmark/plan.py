"""Flags, folders and commands of a benchmark."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Self

from lerobot_bimanual.benchmark.flag_text import (
    OWN_EVALUATION_FLAGS,
    OWN_TRAINING_FLAGS,
    further_flags,
)
from lerobot_bimanual.benchmark.limits import MOST_SEED, check_number, variation_name
from lerobot_bimanual.benchmark.names import (
    dataset_name,
    learner_name,
    perturbed,
    place_name,
    result_name,
    run_name,
)
from lerobot_bimanual.benchmark.pipeline import Command, flag_words
from lerobot_bimanual.benchmark.protocol import PROTOCOLS, Protocol, RecipeName, ScoredSplit
from lerobot_bimanual.benchmark.recipe import Recipe
from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.perturbation_levels import levels_text, parse_levels

PERTURBATIONS = ("perturb", "demos_perturb")


@dataclass
class BenchmarkConfig:
    """What is asked of a benchmark; flags of the verb `benchmark`."""

    policy: str = "peract2"  # type of the policy, as for lerobot-train
    task: str = "lift_ball"  # one registered task, no suite; `lerobot-bimanual task list` lists them
    variation: str = "any"  # index, or `any` for one that each seed draws
    # Tasks and suites, this one among them, from whose demonstrations one network learns. Benchmarks of its tasks share it,
    # and its last checkpoint is scored. By default it learns from this task alone.
    trained_on: str = ""
    recipe: RecipeName = "small"  # file of the policy's training, and the numbers of the protocol
    demos: int | None = None  # demonstrations; by default 100
    image_size: int | None = None  # side in pixels; by default 128 (small) or 256 (paper)
    steps: int | None = None  # optimiser steps; by default the recipe's
    batch_size: int | None = None  # rows of the dataset per step; by default the recipe's
    save_freq: int | None = None  # steps between checkpoints; by default the recipe's
    # Per checkpoint; by default 20 (small) or 100 (paper). 0 scores none, where there is only one to choose.
    val_episodes: int | None = None
    test_episodes: int | None = None  # of the best checkpoint; by default 50 (small) or 100 (paper)
    # Result of another policy on the same task: the test ends as soon as it is sure which of the two is better.
    stop_when_sure: Path | None = None
    seed: int = 1000  # of the training
    # What is different in the test and its controls, and in nothing else: AXIS:LEVEL, several separated by commas.
    perturb: str = ""
    demos_perturb: str = ""  # what is different in the demonstrations, likewise
    first_seed: int = 0  # of the episodes; the splits give other episodes for the same seeds
    # Further flags of the training, in one text; they win over the recipe's.
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
        config: what was asked for.
        recipe: how the policy is trained, with the numbers that were asked for.
        protocol: the other numbers, likewise.
        more_training: flags of `--train_flags`, by name.
        more_evaluation: flags of `--eval_flags`, by name.
    """

    config: BenchmarkConfig
    recipe: Recipe
    protocol: Protocol
    more_training: dict[str, str]
    more_evaluation: dict[str, str]

    @classmethod
    def of(cls, config: BenchmarkConfig) -> Self:
        """Look up recipe and protocol.

        Raises:
            BimanualError: the task or variation is not one, policy or recipe is not installed, a number is out of
                range, nothing would choose among several checkpoints, or further flags are not allowed.
        """
        if not config.task.isidentifier():
            raise BimanualError(f"task is {config.task!r}, but a benchmark is of one task; run one per task")
        config = replace(config, variation=variation_name(config.variation))
        for name, most in MOST_SEED.items():
            check_number(name, getattr(config, name), 0, most)
        if config.trained_on == config.task:
            config = replace(config, trained_on="")
        if config.trained_on:
            _check_several(config)
            config = replace(config, val_episodes=0)
        levels = {name: levels_text(parse_levels(getattr(config, name))) for name in PERTURBATIONS}
        config = replace(config, **levels)
        recipe = Recipe.find(config.policy, config.recipe)
        if config.recipe not in PROTOCOLS:
            raise InvalidChoice("recipe", config.recipe, PROTOCOLS)
        plan = cls(
            config,
            replace(recipe, **_given(config, Recipe)),
            replace(PROTOCOLS[config.recipe], **_given(config, Protocol)),
            further_flags("train_flags", config.train_flags, OWN_TRAINING_FLAGS),
            further_flags("eval_flags", config.eval_flags, OWN_EVALUATION_FLAGS),
        )
        if not plan.protocol.val_episodes and len(plan.checkpoint_steps) > 1 and not config.trained_on:
            raise BimanualError(
                "val_episodes is 0, so that nothing would choose among the checkpoints after "
                f"{', '.join(map(str, plan.checkpoint_steps))} steps; leave one with --save_freq={plan.recipe.steps}"
            )
        return plan

    @property
    def checkpoint_steps(self) -> tuple[int, ...]:
        """Steps after which LeRobot leaves a checkpoint, the last one included."""
        steps, every = self.recipe.steps, self.recipe.save_freq
        return (*range(every, steps, every), steps)

    @property
    def folder(self) -> Path:
        """What the policies of a task share."""
        return self.config.output.resolve() / place_name(self.config.task, self.config.variation)

    @property
    def source(self) -> Path:
        """Where the demonstrations lie, and beside them the policies that were trained on those of several tasks."""
        config = self.config
        return config.output.resolve() / dataset_name(config.task, config.variation, config.trained_on)

    @property
    def dataset(self) -> Path:
        """The demonstrations."""
        kind = self.recipe.view if self.recipe.depth else f"{self.recipe.view}_rgb"
        name = f"{kind}_{self.protocol.image_size}_{self.protocol.demos}"
        return self.source / perturbed(name, self.config.demos_perturb)

    @property
    def training_folder(self) -> Path:
        """The training."""
        return self.source / self._run_name

    @property
    def run_folder(self) -> Path:
        """The evaluations, beside the training unless that is of several tasks."""
        return self.folder / learner_name(self._run_name, self.config.trained_on)

    @property
    def result(self) -> Path:
        """The result's file."""
        config = self.config
        place = perturbed(place_name(config.task, config.variation), config.perturb)
        return self.folder.parent / "results" / result_name(place, self.run_folder.name)

    @property
    def _run_name(self) -> str:
        config = self.config
        return perturbed(run_name(config.policy, config.recipe, config.seed), config.demos_perturb)

    def certificate(self, control: str) -> Path:
        """The result of the expert or a control on the test seeds."""
        name = f"{control}_{self._test_seeds.replace(':', '_')}"
        return self.folder / f"{perturbed(name, self.config.perturb)}.json"

    def checkpoint(self, step: int) -> Path:
        """The policy after so many steps."""
        digits = max(6, len(str(self.recipe.steps)))  # as LeRobot writes them
        return self.training_folder / "train" / "checkpoints" / f"{step:0{digits}d}" / "pretrained_model"

    def weights(self, step: int) -> Path:
        """The weights of the policy after so many steps."""
        return self.checkpoint(step) / "model.safetensors"

    def evaluation_file(self, split: ScoredSplit, step: int, seeds: range | None = None) -> Path:
        """What `lerobot-eval` finds out about a checkpoint, on all seeds or some of them."""
        part = "" if seeds is None else f"_{seeds.start}_{seeds.stop}"
        name = f"{split}_{self.checkpoint(step).parent.name}{part}"
        return self.run_folder / perturbed(name, self._perturb(split)) / "eval_info.json"

    def record_file(self, split: ScoredSplit, step: int, seeds: range | None = None) -> Path:
        """What the environment keeps of that evaluation: every action, to be played again."""
        place = perturbed(place_name(self.config.task, self.config.variation), self._perturb(split))
        return self.evaluation_file(split, step, seeds).with_name(f"{place}_{split}_record.json")

    def generation(self) -> Command:
        """Record the demonstrations; none of their seeds is in the splits of the evaluation."""
        between = ",".join(map(str, self.protocol.intermediate))
        flags = {
            "task": self.config.trained_on or self.config.task,
            "variation": self.config.variation,
            "episodes": self.protocol.demos,
            "split": "train",
            "view": self.recipe.view,
            "image_size": self.protocol.image_size,
            "cameras": ",".join(self.recipe.cameras),
            **({} if self.recipe.depth else {"depth": "false"}),
            **({"intermediate": between} if between and self.recipe.view == "keyframes" else {}),
            "root": self.dataset,
            "repo_id": self._repo_id,
            **_unless_empty("perturb", self.config.demos_perturb),
            "workers": self.config.workers,
        }
        words = ["lerobot-bimanual", "dataset", "generate", *flag_words(flags)]
        return Command(f"generate_{self.dataset.name}", words, output=self.dataset)

    def certification(self, control: str) -> Command:
        """Score the expert or a control on the test seeds."""
        output = self.certificate(control)
        flags = {
            "task": self.config.task,
            "variation": self.config.variation,
            "split": "test",
            "seeds": self._test_seeds,
            "control": control,
            **_unless_empty("perturb", self.config.perturb),
            "workers": self.config.workers,
            "output": output,
        }
        words = ["lerobot-bimanual", "expert", "evaluate", *flag_words(flags)]
        return Command(output.stem, words, output=output, judges=True)

    def training_flags(self) -> dict[str, str]:
        """Flags of `lerobot-train`, by name."""
        flags = self.recipe.flags(self.protocol.image_size) | {
            "dataset.repo_id": self._repo_id,
            "dataset.root": self.dataset,
            **self._device,
            "steps": self.recipe.steps,
            "batch_size": self.recipe.batch_size,
            "num_workers": 0,  # the dataset is in memory
            "log_freq": max(1, self.recipe.save_freq // 5),
            "save_freq": self.recipe.save_freq,
            "seed": self.config.seed,
            "output_dir": self.training_folder / "train",
            **self.more_training,
        }
        return {name: str(value) for name, value in flags.items()}

    def training(self) -> Command:
        """Train with a checkpoint every `save_freq` steps."""
        return Command(
            "train",
            ["lerobot-bimanual-train", *flag_words(self.training_flags())],
            output=self.checkpoint(self.recipe.steps),
            training_folder=self.training_folder / "train",
        )

    def evaluation(self, split: ScoredSplit, step: int, seeds: range | None = None) -> Command:
        """Score one checkpoint, on all seeds or some of them."""
        evaluation = self.evaluation_file(split, step, seeds)
        played = self.seeds(split) if seeds is None else seeds
        flags = {
            "policy.path": self.checkpoint(step),
            **self._device,
            "env.type": "bimanual",
            "env.task": self.config.task,
            "env.variation": self.config.variation,
            "env.split": split,
            **_unless_empty("env.perturb", self._perturb(split)),
            "env.image_size": self.protocol.image_size,
            "env.cameras": ",".join(self.recipe.cameras),
            **({} if self.recipe.depth else {"env.obs": "rgb"}),
            "env.results_dir": evaluation.parent,
            "eval.n_episodes": len(played),
            "eval.batch_size": 2,
            "seed": played.start,
            "output_dir": evaluation.parent,
            **self.more_evaluation,
        }
        words = ["lerobot-eval", *flag_words(flags)]
        return Command(evaluation.parent.name, words, output=evaluation, inputs=(self.weights(step),))

    def evaluations(self, step: int) -> Iterator[Command]:
        """All evaluations, that on the split `test` with the checkpoint after so many steps."""
        if self.protocol.val_episodes:
            yield from (self.evaluation("val", step) for step in self.checkpoint_steps)
        yield self.evaluation("test", step)

    def commands(self, step: int) -> list[Command]:
        """Every command in its order, when the checkpoint after so many steps is the best."""
        certifications = [self.certification(control) for control in ("expert", "blind")]
        return [self.generation(), *certifications, self.training(), *self.evaluations(step)]

    def _perturb(self, split: ScoredSplit) -> str:
        return self.config.perturb if split == "test" else ""

    @property
    def _device(self) -> dict[str, str]:
        return {} if self.config.device is None else {"policy.device": self.config.device}

    @property
    def _repo_id(self) -> str:
        return f"benchmark/{self.source.name}"

    def seeds(self, split: ScoredSplit) -> range:
        """Seeds of the evaluations on a split."""
        count = self.protocol.val_episodes if split == "val" else self.protocol.test_episodes
        return range(self.config.first_seed, self.config.first_seed + count)

    @property
    def _test_seeds(self) -> str:
        return f"{self.seeds('test').start}:{self.seeds('test').stop}"


def _check_several(config: BenchmarkConfig) -> None:
    """What does not go with a network for several tasks."""
    if not all(name.isidentifier() for name in config.trained_on.split(",")):
        raise BimanualError(
            f"trained_on is {config.trained_on!r}, but must be tasks and suites, separated by commas"
        )
    if config.variation != "any":
        raise BimanualError(
            f"variation is {config.variation}, but --trained_on={config.trained_on} has demonstrations of any: leave it out"
        )
    if config.val_episodes:
        raise BimanualError(
            f"val_episodes is {config.val_episodes}, but of a network for several tasks (--trained_on) the last checkpoint is "
            "scored, since each task would choose another: leave it out"
        )


def _unless_empty(flag: str, value: str) -> dict[str, str]:
    return {flag: value} if value else {}


def _given(config: BenchmarkConfig, kind: type) -> dict[str, int]:
    """The numbers of a recipe or protocol that were asked for."""
    numbers = {field.name: getattr(config, field.name, None) for field in fields(kind)}
    given = {name: number for name, number in numbers.items() if number is not None}
    for name, number in given.items():
        check_number(name, number, 0 if name == "val_episodes" else 1)
    return given
