"""What a benchmark measured, as one JSON file that says how it came about."""

import json
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.benchmark.episode_result import (
    EpisodeResult,
    Validation,
    best_checkpoint,
    success_rate,
)
from lerobot_bimanual.benchmark.flag_text import command_flags
from lerobot_bimanual.benchmark.names import (
    dataset_name,
    learner_name,
    perturbed,
    place_name,
    result_name,
    run_name,
)
from lerobot_bimanual.benchmark.training_record import DatasetRecord, Machine
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.played_episode import PlayedEpisode
from lerobot_bimanual.evaluation.record import RECORD_SCHEMA_VERSION, EvaluationRecord
from lerobot_bimanual.json_file import parse_json, read_bytes, shown
from lerobot_bimanual.json_record import decode
from lerobot_bimanual.results.statistics import SuccessRate
from lerobot_bimanual.versions import SIMULATION_PACKAGES

ROW_SCHEMA_VERSION = 3
PLACES = ("dataset.root", "output_dir")
"""Training flags that only say where things lie; a row does without them."""

NUMBERS = ("steps", "batch_size", "save_freq", "seed")
"""Training flags that every row has."""

RATES = "rates"
"""Key of the success rates in the file; they follow from the episodes and are there for readers."""


class BadResult(BimanualError):
    """A result that is not what this version writes; the message names the field."""


@dataclass(frozen=True)
class ResultRow:
    """One policy on one task.

    Attributes:
        schema_version: version of this table of fields.
        task: name of the task.
        world: version of what the task's world does, as its certificates have it; rows of two worlds are not compared.
        variation: index of the variation, or `any`.
        policy: type of the policy.
        recipe: `small` or `paper`.
        flags: flags of the training command by name, but for folders.
        dataset: what the policy learned from.
        checkpoint_step: optimiser steps of the checkpoint that was tested.
        checkpoint_sha256: of its `model.safetensors`.
        validation: every checkpoint on the validation split, from which the tested one was chosen; empty where there
            was only one, so that nothing was to be chosen, or where the last was taken, as of a network for several tasks.
        split: split of `episodes`, `expert` and `blind`.
        options: of the environment in which the policy was tested, by name.
        batch_size: environments side by side then.
        episodes: the policy, one entry per seed, with all that is needed to play it again.
        stopped_against: checkpoint_sha256 of another policy's row, if the test went on only until it was sure which of the
            two is better; such a row is for comparisons, since its rate is biased. None for a fixed number of episodes.
        expert: the expert on the same seeds.
        blind: the blind control on the same seeds, on each variation if `variation` is `any`.
        training_seconds: wall time of the training command.
        machine: where it ran.
        versions: package -> version.
        date: day of the evaluation, ISO 8601.

    Raises:
        ValueError: a value is impossible or contradicts another.
    """

    schema_version: int
    task: str
    world: str
    variation: str
    policy: str
    recipe: str
    flags: dict[str, str]
    dataset: DatasetRecord
    checkpoint_step: int
    checkpoint_sha256: str
    validation: tuple[Validation, ...]
    split: str
    options: dict[str, str]
    batch_size: int
    episodes: tuple[PlayedEpisode, ...]
    stopped_against: str | None
    expert: tuple[EpisodeResult, ...]
    blind: tuple[EpisodeResult, ...]
    training_seconds: float
    machine: Machine
    versions: dict[str, str]
    date: str

    def __post_init__(self) -> None:
        for name, holds, rule in self._rules():
            if not holds:
                raise ValueError(f"field {name!r} is {shown(getattr(self, name))}, but {rule}")

    def _rules(self) -> Iterator[tuple[str, object, str]]:
        """Name of a field, whether it is right, and what it must be; later rules build on earlier ones."""
        yield "schema_version", self.schema_version == ROW_SCHEMA_VERSION, f"must be {ROW_SCHEMA_VERSION}"
        yield "task", self.task.isidentifier(), "must be the name of a task"
        yield "world", re.fullmatch("[0-9a-f]{12}", self.world), "must be 12 hex digits"
        yield "variation", re.fullmatch("any|[0-9]{1,4}", self.variation), "must be an index or any"
        for name in ("policy", "recipe"):
            yield name, re.fullmatch(r"\w[\w.-]*", getattr(self, name)), "must be a name"
        hexadecimal = re.fullmatch("[0-9a-f]{64}", self.checkpoint_sha256)
        yield "checkpoint_sha256", hexadecimal, "must be 64 hex digits"
        stopped = self.stopped_against is None or re.fullmatch("[0-9a-f]{64}", self.stopped_against)
        yield "stopped_against", stopped, "must be 64 hex digits or nothing"
        yield "split", self.split == "test", "must be test: what is chosen on val is scored on test"
        of_split = self.options.get("split") == self.split
        yield "options", of_split, f"must hold the split {self.split!r}"
        yield "batch_size", self.batch_size > 0, "must be at least 1"
        yield "training_seconds", self.training_seconds >= 0, "must not be negative"
        yield "date", _is_day(self.date), "must be a day, YYYY-MM-DD"
        gpu = self.machine.gpu or "none"
        yield "machine", gpu.isprintable() and "|" not in gpu and self.machine.cpus > 0, "must be a machine"
        yield from self._rules_of_training()
        yield from self._rules_of_episodes()

    def _rules_of_training(self) -> Iterator[tuple[str, object, str]]:
        numbers = all(re.fullmatch("[0-9]{1,9}", self.flags.get(name, "")) for name in NUMBERS)
        yield "flags", numbers, f"must hold the numbers {', '.join(NUMBERS)}"
        positive = all(int(self.flags[name]) for name in ("steps", "batch_size", "save_freq"))
        yield "flags", positive, "steps, batch_size and save_freq must be at least 1"
        printable = "".join([*self.flags, *self.flags.values()]).isprintable()
        yield "flags", printable, "must hold flags of one line each"
        named = all(name.isidentifier() for name in self.trained_on.split(",")) or not self.trained_on
        yield "dataset", named, "--task of its command must be names of tasks and suites, separated by commas"
        demonstrated = dataset_name(self.task, self.variation, self.trained_on)
        for flag, value in (("policy.type", self.policy), ("dataset.repo_id", f"benchmark/{demonstrated}")):
            got = self.flags.get(flag)
            yield (
                "flags",
                got == value,
                f"{flag} must be {value!r} and not {shown(got)}, as the row is of that",
            )
        seeds = self.dataset.seeds
        rising = bool(seeds) and seeds[0] >= 0 and list(seeds) == sorted(set(seeds))
        yield "dataset", rising, "its seeds must be there and rise"
        recorded = command_flags(self.dataset.command)
        for flag, value in {
            "task": self.trained_on or self.task,
            "variation": self.variation,
            "split": "train",
            "episodes": str(len(seeds)),
            "image_size": f"{self.dataset.image_size}x{self.dataset.image_size}",
        }.items():
            got = recorded.get(flag)
            yield "dataset", got == value, f"--{flag} of its command must be {value!r} and not {shown(got)}"
        for package in SIMULATION_PACKAGES:
            one, other = self.dataset.versions.get(package), self.versions.get(package)
            same = one is not None and one == other
            yield (
                "versions",
                same,
                f"{package} must be that of the dataset, {shown(one)}, and not {shown(other)}",
            )

    def _rules_of_episodes(self) -> Iterator[tuple[str, object, str]]:
        seeds = [episode.seed for episode in self.episodes]
        listed = bool(seeds) and seeds[0] >= 0 and seeds == list(range(seeds[0], seeds[0] + len(seeds)))
        yield "episodes", listed, "must not be empty, nor repeat or leave out a seed"
        steps, every = int(self.flags["steps"]), int(self.flags["save_freq"])
        count = -(-steps // every)
        saved = [every * number for number in range(1, min(count, len(self.validation) + 1))] + [steps]
        validated = [validation.step for validation in self.validation]
        nothing_to_choose = count == 1 or bool(self.trained_on)
        complete = validated == saved or (nothing_to_choose and not validated)
        yield (
            "validation",
            complete,
            f"must be of every checkpoint: {count} of them, each {every} steps up to {steps}",
        )
        for validation in self.validation:
            on_val = [episode.seed for episode in validation.episodes]
            same = on_val == list(range(seeds[0], seeds[0] + len(self.validation[0].episodes))) != []
            yield "validation", same, f"must be on the same seeds from {seeds[0]} on for every checkpoint"
        best = best_checkpoint(self.validation).step if self.validation else steps
        yield "checkpoint_step", self.checkpoint_step == best, f"the best on val is that after {best} steps"
        for who in ("expert", "blind"):
            played: tuple[EpisodeResult, ...] = getattr(self, who)
            whole = all(
                episode.variation is not None and (episode.failure is None) == episode.success
                for episode in played
            )
            yield (
                who,
                whole,
                "each episode must have a variation, and a failure just if it is none of success",
            )
            of_variation = all(str(episode.variation) == self.variation for episode in played)
            yield who, of_variation or self.variation == "any", f"must be of the variation {self.variation}"
        expected = sorted(episode.seed for episode in self.expert)
        yield "expert", expected == seeds, f"must be on the seeds of the policy, {shown(seeds)}, each once"
        variations = len({episode.variation for episode in self.blind}) or 1
        first = int(self.variation) if self.variation.isdecimal() else 0
        grid = {(first + index, seed) for index in range(variations) for seed in seeds}
        blind = [(episode.variation, episode.seed) for episode in self.blind]
        complete = len(blind) == len(grid) and set(blind) == grid
        yield (
            "blind",
            complete,
            f"must be on the seeds of the policy, {shown(seeds)}, each once per variation",
        )

    @property
    def evaluation(self) -> EvaluationRecord:
        """The policy's episodes by themselves, as `lerobot-eval` has left them."""
        return EvaluationRecord(
            RECORD_SCHEMA_VERSION,
            self.task,
            self.world,
            self.options,
            self.batch_size,
            self.versions,
            self.episodes,
        )

    @property
    def place(self) -> str:
        """What the line of the row's task, variation and perturbation is called."""
        return perturbed(place_name(self.task, self.variation), self.evaluation.perturb)

    @property
    def file_name(self) -> str:
        """What a benchmark calls the row's file."""
        run = run_name(self.policy, self.recipe, int(self.flags["seed"]))
        run = perturbed(run, self.demos_perturb)
        return result_name(self.place, learner_name(run, self.trained_on))

    @property
    def trained_on(self) -> str:
        """Tasks and suites from whose demonstrations the policy learned; empty if they are of its task alone."""
        tasks = command_flags(self.dataset.command).get("task", self.task)
        return "" if tasks == self.task else tasks

    @property
    def demos_perturb(self) -> str:
        """What was different in the demonstrations, `AXIS:LEVEL,...`."""
        return command_flags(self.dataset.command).get("perturb", "")

    @property
    def learner(self) -> str:
        """The policy, and what it learned from if that is not its task alone as it is; what its column is called."""
        return learner_name(perturbed(self.policy, self.demos_perturb), self.trained_on)

    @property
    def rates(self) -> dict[str, SuccessRate]:
        """Success of policy, expert and blind control."""
        return {
            "policy": success_rate(self.episodes),
            "expert": success_rate(self.expert),
            "blind": success_rate(self.blind),
        }

    def to_json(self) -> str:
        """The row as a JSON text, success rates included."""
        return json.dumps(asdict(self) | {RATES: _rates_as_json(self)}, indent=1) + "\n"

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """The row of such a text.

        Raises:
            BadResult: the text is no JSON, a field is missing, unknown or of another kind, its value is impossible,
                or the success rates are not those of the episodes.
        """
        try:
            content = parse_json(text)
        except BimanualError as error:
            raise BadResult(f"a result {error}") from error
        rates = content.pop(RATES, None) if isinstance(content, dict) else None
        try:
            row = decode(cls, content, "result")
        except BimanualError as error:
            raise BadResult(str(error)) from error
        if rates != _rates_as_json(row):
            raise BadResult(
                f"field {RATES!r} is {shown(rates, 400)}, but the episodes give {shown(_rates_as_json(row), 400)}"
            )
        return row

    @classmethod
    def read(cls, path: Path) -> Self:
        """The row in a file.

        Raises:
            BadResult: the file cannot be read, or as in `from_json`.
        """
        try:
            return cls.from_json(read_bytes(path))
        except (OSError, BimanualError) as error:
            raise BadResult(f"{path}: {error}") from error


def _rates_as_json(row: ResultRow) -> dict[str, dict[str, Any]]:
    return {
        who: {"successes": rate.successes, "trials": rate.trials, "wilson_95": list(rate.interval)}
        for who, rate in row.rates.items()
    }


def _is_day(text: str) -> bool:
    try:
        return date.fromisoformat(text).isoformat() == text
    except ValueError:
        return False
