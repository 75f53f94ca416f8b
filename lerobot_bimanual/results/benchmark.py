"""One policy on one task, as a JSON file that says how the result came about."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, JsonValue, NonNegativeFloat, NonNegativeInt, PositiveInt, model_validator

from lerobot_bimanual.distributions import SIMULATION_PACKAGES
from lerobot_bimanual.resources import usable_cores
from lerobot_bimanual.results.episode import (
    MAX_EPISODES,
    Episode,
    EpisodeCount,
    Episodes,
    ProvedEpisodes,
    Sha256,
    success_rate,
)
from lerobot_bimanual.results.evaluation import EvaluationRecord, WorldVersion, eval_key, with_perturb_suffix
from lerobot_bimanual.results.protocols import protocol_of
from lerobot_bimanual.results.record import BadRecord, Name, Record, Text, require
from lerobot_bimanual.results.statistics import SuccessRate

Seed = Annotated[int, Field(ge=0, le=10**9 - 1)]
Count = Annotated[int, Field(ge=1, le=10**9 - 1)]
MAX_CHECKPOINTS = 10_000
"""A larger number is a mistake, and a list of so many steps would fill the memory."""
MAX_FILE_NAME = 170
"""File systems allow 255, of which `write_file` needs some for its own."""
INCIDENTAL = ("num_workers", "wandb.enable", "keep_last")
"""Training options that decide nothing about what is learned."""


class BenchmarkSettings(Record):
    """Settings of a benchmark, with every default of its recipe and protocol filled in.

    Two benchmarks with equal settings are the same measurement. Fields have the names and meanings of the flags of `policy
    benchmark`, which its help explains, except for these:

    Attributes:
        task: the one that is scored.
        trained_on: as the flag; empty for the task alone.
        demos_variation: as the flag; empty for the variation of the test.
        device: torch device; None if LeRobot chose it.
        training: further options of `lerobot-train` by name: those of the recipe, and those that were given beside it.
        evaluation: further options of `lerobot-eval` by name.
        protocol: name of the protocol that has these flags.
    """

    policy: Name
    task: Name
    variation: Annotated[str, Field(pattern="^(any|[0-9]{1,4})$")] = "any"
    trained_on: str = ""
    recipe: Name
    demos: Count
    image_size: Count
    steps: Count
    batch_size: Count
    save_freq: Count
    val_episodes: Annotated[int, Field(ge=0, le=MAX_EPISODES)]
    test_episodes: EpisodeCount
    seed: Seed
    first_seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    perturb: str = ""
    demos_perturb: str = ""
    demos_plans: Literal["one", "several"] = "one"
    demos_variation: Annotated[str, Field(pattern="^([0-9]{1,4}(,[0-9]{1,4})*)?$")] = ""
    first_demo_seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    setting: Literal["standard", "varied"] = "standard"
    device: str | None = None
    training: dict[str, JsonValue]
    evaluation: dict[str, JsonValue] = Field(default={})
    protocol: Name = Field(default_factory=protocol_of)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        name = protocol_of(vars(self))
        require(self.protocol == name, f"protocol is {self.protocol!r}, but its flags are those of {name!r}")
        few = self.steps <= MAX_CHECKPOINTS * self.save_freq
        require(few, f"save_freq must leave at most {MAX_CHECKPOINTS} checkpoints")
        length = len(self.file_name)
        is_short = length <= MAX_FILE_NAME
        require(
            is_short, f"the result's file would have a name of {length} letters: name fewer tasks or axes"
        )
        return self

    @property
    def eval_key(self) -> str:
        """Name of what is scored: the task, or one variation of it, with its perturbations."""
        return eval_key(self.task, self.variation, self.perturb, self.setting)

    @property
    def policy_id(self) -> str:
        """The policy, with what it learned from if that is not its nominal task alone."""
        return self._with_training_suffix(self.policy)

    @property
    def run_id(self) -> str:
        """Name of the training: `policy_id` with recipe and seeds."""
        return self._with_training_suffix(
            self.with_seed_suffix(f"{self.policy}_{self.recipe}_seed{self.seed}")
        )

    @property
    def file_name(self) -> str:
        """Name of the result's file."""
        return f"{self.eval_key}_{self.run_id}.json"

    @property
    def checkpoint_steps(self) -> tuple[int, ...]:
        """Steps after which LeRobot leaves a checkpoint, the last one included."""
        return (*range(self.save_freq, self.steps, self.save_freq), self.steps)

    def with_seed_suffix(self, name: str) -> str:
        """A name with the seed of the first demonstration, if that is not the usual one."""
        return f"{name}_from{self.first_demo_seed}" if self.first_demo_seed else name

    def with_demos_suffix(self, name: str) -> str:
        """A name with what is special about the demonstrations: perturbations, few, several plans, other variations."""
        name = with_perturb_suffix(name, self.demos_perturb)
        name += "_few" if self.protocol == "few" else ""
        name += "_plans" if self.demos_plans == "several" else ""
        return name + (f"_of{self.demos_variation.replace(',', '.')}" if self.demos_variation else "")

    def _with_training_suffix(self, name: str) -> str:
        name = self.with_demos_suffix(name)
        return f"{name}_on_{self.trained_on.replace(',', '.')}" if self.trained_on else name


class Demonstrations(Record):
    """Dataset that the policy learned from.

    Attributes:
        settings: settings of the dataset's generation, by name; with `versions` they make it again.
        seeds: seed of each demonstration of the task that is scored, in the split `train`.
        versions: package -> version with which it was made.
    """

    settings: dict[str, JsonValue]
    seeds: tuple[NonNegativeInt, ...]
    versions: dict[str, str]


class Machine(Record):
    """Machine on which a policy was trained.

    Attributes:
        cpus: cores that the training could use.
        gpu: name of the first GPU if it was used.
        instructions: widest vector instructions that torch used; with others weights differ. None in older results.
    """

    cpus: PositiveInt
    gpu: Text | None = None
    instructions: Text | None = None

    @classmethod
    def this(cls, device: str | None) -> Self:
        """The machine at hand, for a training on that device of torch, or on the one that LeRobot chooses."""
        import torch

        gpu = torch.cuda.get_device_name(0) if device != "cpu" and torch.cuda.is_available() else None
        return cls(cpus=usable_cores(), gpu=gpu, instructions=torch.backends.cpu.get_cpu_capability())


class Validation(Record):
    """Episodes of the validation split with the checkpoint after `step` optimiser steps."""

    step: PositiveInt
    episodes: Episodes


class BenchmarkResult(Record):
    """One policy on one task, beside the expert and the open-loop baseline on the same episodes.

    Attributes:
        schema_version: version of these fields.
        config: what was measured.
        world: version of what the task's world does; results of two worlds are not compared.
        demonstrations: what the policy learned from.
        checkpoint_step: optimiser steps of the checkpoint that was tested.
        checkpoint_sha256: of its `model.safetensors`.
        training_seconds: wall time of the training, without runs that were killed outright.
        machine: where it ran.
        options: options of the environment in which the policy was tested, by name.
        batch_size: environments side by side in the test.
        versions: package -> version in the test.
        date: day of the test, ISO 8601.
        validation: every checkpoint on the split `val`, from which the tested one was chosen; empty if the last was
            taken without a choice.
        episodes: the policy on the split `test`, with proofs.
        expert: the expert on the same seeds.
        open_loop: the open-loop baseline on the same seeds, on each variation if the policy was tested on any.
    """

    schema_version: Literal[4]
    config: BenchmarkSettings
    world: WorldVersion
    demonstrations: Demonstrations
    checkpoint_step: PositiveInt
    checkpoint_sha256: Sha256
    training_seconds: NonNegativeFloat
    machine: Machine
    options: dict[str, str | int]
    batch_size: PositiveInt
    versions: dict[str, str]
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
    validation: tuple[Validation, ...]
    episodes: ProvedEpisodes
    expert: Episodes
    open_loop: tuple[Episode, ...]

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        seeds = [*range(self.config.first_seed, self.config.first_seed + self.config.test_episodes)]
        for name, episodes in (("episodes", self.episodes), ("expert", self.expert)):
            same = [episode.seed for episode in episodes] == seeds
            require(same, f"{name} must be on the {len(seeds)} seeds from {self.config.first_seed} on")
        require({*seeds} == {each.seed for each in self.open_loop}, "open_loop must be on the same seeds")
        same = [each.variation for each in self.episodes] == [each.variation for each in self.expert]
        require(same, "episodes must have the variations of the expert's")
        played = {"split": "test"} | {
            each: getattr(self.config, each) for each in ("variation", "setting", "perturb")
        }
        for name, value in played.items():
            require(str(self.options.get(name)) == value, f"options: {name} must be {value!r}, as in config")
        steps = self.config.checkpoint_steps
        chosen = {self.checkpoint_step, *(each.step for each in self.validation)}
        require(chosen <= {*steps}, f"checkpoints must be among those after {steps} steps")
        for package in SIMULATION_PACKAGES:
            recorded, tested = self.demonstrations.versions.get(package), self.versions.get(package)
            require(recorded == tested, f"{package} must be the same in demonstrations and test")
        return self

    @property
    def task(self) -> str:
        """Name of the task that is scored."""
        return self.config.task

    @property
    def evaluation(self) -> EvaluationRecord:
        """The policy's episodes by themselves, as `lerobot-eval` left them."""
        shared = ("task", "world", "options", "batch_size", "versions", "episodes")
        return EvaluationRecord(schema_version=2, **{name: getattr(self, name) for name in shared})

    @property
    def eval_key(self) -> str:
        """Name of what is scored."""
        return self.config.eval_key

    @property
    def policy_id(self) -> str:
        """The policy, with what it learned from if that is not its nominal task alone."""
        return self.config.policy_id

    @property
    def rates(self) -> dict[str, SuccessRate]:
        """Success of `policy`, `expert` and `open_loop` on the split `test`."""
        return {
            "policy": success_rate(self.episodes),
            "expert": success_rate(self.expert),
            "open_loop": success_rate(self.open_loop),
        }


type Scored = BenchmarkResult | EvaluationRecord
"""A policy's episodes on one task; only a `BenchmarkResult` says how it was trained."""


def read_scored(path: Path) -> Scored:
    """The result or the record in a file; one that holds neither is a `BadRecord`."""
    try:
        return EvaluationRecord.read(path)
    except BadRecord as error:
        if "schema_version" not in str(error):
            raise
    try:
        return BenchmarkResult.read(path)
    except BadRecord as error:
        if "schema_version" not in str(error):
            raise
        raise BadRecord(
            f"{error}; it is no result of a benchmark and no record of an evaluation of this version; for a file of `policy "
            f"robustness`, give the folder {path.stem}_records beside it"
        ) from None
