"""Folders and commands of a benchmark."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Self

from lerobot_bimanual.benchmark.config import BenchmarkConfig, flag_words, resolve
from lerobot_bimanual.benchmark.pipeline import Command
from lerobot_bimanual.benchmark.recipes import Recipe, sizes
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset.schema import PROVENANCE_FILE
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.results.benchmark import BenchmarkSettings
from lerobot_bimanual.results.evaluation import STANDARD, eval_key, with_perturb_suffix

ScoredSplit = Literal["val", "test"]
BASELINES = ("expert", "open_loop")
"""Agents that are scored beside the policy."""


@dataclass(frozen=True)
class Plan:
    """Folders and commands of one benchmark; folders and workers are those of `BenchmarkConfig`."""

    settings: BenchmarkSettings
    recipe: Recipe
    output: Path
    workers: int
    video_dir: Path | None

    @classmethod
    def of(cls, config: BenchmarkConfig) -> Self:
        """The plan of a benchmark; `resolve` refuses flags that are not allowed."""
        return cls(
            settings=resolve(config),
            recipe=Recipe.find(config.policy, config.recipe),
            output=_place("output", config.output),
            workers=config.workers,
            video_dir=config.video_dir and _place("video_dir", config.video_dir),
        )

    @property
    def folder(self) -> Path:
        """What the policies of a task share."""
        return self.output / eval_key(self.settings.task, self.settings.variation, "", self.settings.setting)

    @property
    def source(self) -> Path:
        """Folder of the demonstrations; policies that learn from those of several tasks are trained there, too."""
        several = self.settings.trained_on.replace(",", ".")
        return self.output / eval_key(several, "any", "", self.settings.setting) if several else self.folder

    @property
    def dataset(self) -> Path:
        """The demonstrations."""
        kind = self.recipe.view if self.recipe.depth else f"{self.recipe.view}_rgb"
        if self.recipe.cameras != CAMERA_NAMES:
            kind += f"_{'.'.join(self.recipe.cameras)}"
        kind += "_on_the_way" if self._intermediate else ""
        name = self.settings.with_seed_suffix(f"{kind}_{self.settings.image_size}_{self.settings.demos}")
        return self.source / self.settings.with_demos_suffix(name)

    @property
    def training_folder(self) -> Path:
        """The training."""
        return self.source / self.settings.model_copy(update={"trained_on": ""}).run_id

    @property
    def run_folder(self) -> Path:
        """Folder of the evaluations; also of the training, unless that is on several tasks."""
        return self.folder / self.settings.run_id

    @property
    def result(self) -> Path:
        """The result's file."""
        return self.output / "results" / self.settings.file_name

    def report(self, player: str) -> Path:
        """Report of the expert or of a baseline on the test seeds."""
        seeds = self.seeds("test")
        name = with_perturb_suffix(f"{player}_{seeds.start}_{seeds.stop}", self.settings.perturb)
        return self.folder / f"{name}.json"

    def checkpoint(self, step: int) -> Path:
        """The policy after so many steps."""
        digits = max(6, len(str(self.settings.steps)))  # as LeRobot writes them
        return self.training_folder / "train" / "checkpoints" / f"{step:0{digits}d}" / "pretrained_model"

    def weights(self, step: int) -> Path:
        """The weights of the policy after so many steps."""
        return self.checkpoint(step) / "model.safetensors"

    def evaluation_folder(self, split: ScoredSplit, step: int) -> Path:
        """What `lerobot-eval` writes for a checkpoint."""
        name = f"{split}_{self.checkpoint(step).parent.name}"
        return self.run_folder / with_perturb_suffix(name, self._perturb(split))

    def record_file(self, split: ScoredSplit, step: int) -> Path:
        """The environment's record of that evaluation, with every action."""
        settings = self.settings
        key = eval_key(settings.task, settings.variation, self._perturb(split), settings.setting)
        return self.evaluation_folder(split, step) / f"{key}_{split}_record.json"

    def seeds(self, split: ScoredSplit) -> range:
        """Seeds of the evaluations on a split."""
        settings = self.settings
        count = settings.val_episodes if split == "val" else settings.test_episodes
        return range(settings.first_seed, settings.first_seed + count)

    def generation(self) -> Command:
        """Record the demonstrations; the splits of the evaluation have other episodes for the same seeds."""
        settings = self.settings
        options = {
            "task": settings.trained_on or settings.task,
            "variation": settings.demos_variation or settings.variation,
            "episodes": settings.demos,
            "first_seed": settings.first_demo_seed or None,
            "split": "train",
            "view": self.recipe.view,
            "image_size": settings.image_size,
            "cameras": ",".join(self.recipe.cameras),
            "depth": None if self.recipe.depth else False,
            "intermediate": ",".join(map(str, self._intermediate)),
            "root": str(self.dataset),
            "repo_id": self._repo_id,
            "perturb": settings.demos_perturb,
            "setting": self._setting,
            "plans": "" if settings.demos_plans == "one" else settings.demos_plans,
            "workers": self.workers,
        }
        words = ["lerobot-bimanual", "dataset", "generate", *flag_words(_without_empty_options(options))]
        return Command(f"generate_{self.dataset.name}", words, output=self.dataset)

    def baseline(self, player: str) -> Command:
        """Score the expert or a baseline on the test seeds."""
        settings, seeds, report = self.settings, self.seeds("test"), self.report(player)
        options = {
            "task": settings.task,
            "variation": settings.variation,
            "split": "test",
            "first_seed": seeds.start,
            "episodes": len(seeds),
            "player": "replanning" if player == "expert" and settings.perturb else player,
            "perturb": settings.perturb,
            "setting": self._setting,
            "workers": self.workers,
            "output": str(report),
        }
        words = ["lerobot-bimanual", "expert", "evaluate", *flag_words(_without_empty_options(options))]
        return Command(report.stem, words, output=report, allows_exit_code_1=True)

    def training(self) -> Command:
        """Train with a checkpoint every `save_freq` steps."""
        settings, folder = self.settings, self.training_folder / "train"
        options = {
            "policy.type": settings.policy,
            "policy.device": settings.device,
            "dataset.repo_id": self._repo_id,
            "dataset.root": str(self.dataset),
            "steps": settings.steps,
            "batch_size": settings.batch_size,
            "save_freq": settings.save_freq,
            "seed": settings.seed,
            "output_dir": str(folder),
        }
        words = ["lerobot-bimanual-train", *flag_words(_without_empty_options(options) | settings.training)]
        learned = (self.dataset / PROVENANCE_FILE,)
        return Command("train", words, self.checkpoint(settings.steps), learned, training_folder=folder)

    def evaluation(self, split: ScoredSplit, step: int) -> Command:
        """Score one checkpoint."""
        settings, folder, seeds = self.settings, self.evaluation_folder(split, step), self.seeds(split)
        options = {
            "policy.path": str(self.checkpoint(step)),
            "policy.device": settings.device,
            "env.type": "bimanual",
            "env.task": settings.task,
            "env.variation": settings.variation,
            "env.split": split,
            "env.perturb": self._perturb(split),
            "env.setting": self._setting,
            "env.image_size": settings.image_size,
            "env.cameras": ",".join(self.recipe.cameras),
            "env.obs": None if self.recipe.depth else "rgb",
            "env.control_mode": self.recipe.control_mode,
            "env.results_dir": str(folder),
            "env.video_dir": self.video_dir and str(self.video_dir / settings.run_id / folder.name),
            "eval.n_episodes": len(seeds),
            "eval.batch_size": 2,
            "seed": seeds.start,
            "output_dir": str(folder),
        }
        words = ["lerobot-eval", *flag_words(_without_empty_options(options) | settings.evaluation)]
        return Command(folder.name, words, folder / "eval_info.json", inputs=(self.weights(step),))

    def commands(self, step: int) -> Iterator[Command]:
        """All commands in order, if the checkpoint after `step` steps is the best."""
        yield from map(self.baseline, BASELINES)  # first: they refuse an impossible test
        yield self.generation()
        yield self.training()
        if self.settings.val_episodes:
            yield from (self.evaluation("val", saved) for saved in self.settings.checkpoint_steps)
        yield self.evaluation("test", step)

    def _perturb(self, split: ScoredSplit) -> str:
        return self.settings.perturb if split == "test" else ""

    @property
    def _intermediate(self) -> tuple[float, ...]:
        """Where on the way to a keypose the demonstrations keep observations, as fractions of the motion."""
        return sizes(self.settings.recipe).intermediate if self.recipe.view == "keyframes" else ()

    @property
    def _setting(self) -> str:
        """The setting as a flag; empty where it is the default."""
        return "" if self.settings.setting == STANDARD else self.settings.setting

    @property
    def _repo_id(self) -> str:
        return f"benchmark/{self.source.name}"


def _place(name: str, path: Path) -> Path:
    """An option's absolute path.

    Raises:
        InvalidChoice: LeRobot, which reads flags as YAML, would cut it.
    """
    if re.search(r" #|: ", str(path := path.resolve())):
        raise InvalidChoice(name, str(path), "a path without ' #' and ': ', where LeRobot would cut it")
    return path


def _without_empty_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options without those that are empty."""
    return {name: value for name, value in options.items() if value not in (None, "")}
