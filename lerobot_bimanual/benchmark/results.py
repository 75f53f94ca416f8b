"""What a benchmark measured, as one JSON file that says how it came about."""

import json
import platform
import re
import types
import typing
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, is_dataclass
from os import cpu_count
from pathlib import Path
from typing import Any, Self

from lerobot_bimanual.dataset.provenance import STAMPED_PACKAGES, installed_versions
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.json_file import parse_json, read_json
from lerobot_bimanual.statistics import SuccessRate

ROW_SCHEMA_VERSION = 2
RESULT_PACKAGES = (*STAMPED_PACKAGES, "lerobot_policy_bimanual", "torch")
PLACES = ("dataset.root", "output_dir")
"""Training flags that only say where things lie; a row does without them."""

NUMBERS = ("steps", "batch_size", "save_freq", "seed")
"""Training flags that every row has."""

RATES = "rates"
"""Key of the success rates in the file; they follow from the episodes and are there for readers."""


class BadResult(BimanualError):
    """A result that is not what this version writes; the message names the field."""


@dataclass(frozen=True)
class EpisodeResult:
    """One episode.

    Attributes:
        seed: seed of the reset, in the split of the row.
        success: whether it was solved.
        variation: index of the variation; None if the evaluation does not tell (`lerobot-eval` does not).
        failure: why it was not solved; None if the evaluation does not tell, or if it was.
        state_hash: SHA-256 of the simulation's final state; None if the evaluation does not tell.
    """

    seed: int
    success: bool
    variation: int | None = None
    failure: str | None = None
    state_hash: str | None = None


@dataclass(frozen=True)
class Validation:
    """Episodes of the validation split with one checkpoint."""

    step: int
    episodes: tuple[EpisodeResult, ...]


@dataclass(frozen=True)
class DatasetRecord:
    """What the policy learned from.

    Attributes:
        command: command line that makes the dataset again, with every option.
        image_size: side of its images in pixels.
        seeds: seed of each demonstration, in the split `train`.
        versions: package -> version with which it was made.
    """

    command: str
    image_size: int
    seeds: tuple[int, ...]
    versions: dict[str, str]


@dataclass(frozen=True)
class Machine:
    """Where the policy was trained."""

    cpus: int
    gpu: str | None

    @classmethod
    def this(cls) -> Self:
        """The machine at hand, with its first GPU."""
        import torch

        gpu = torch.cuda.get_device_name(0) if torch.cuda.is_available() else None
        return cls(cpu_count() or 1, gpu)


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
            was only one, so that nothing was to be chosen.
        split: split of `episodes`, `expert` and `blind`.
        episodes: the policy, one entry per seed.
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
    episodes: tuple[EpisodeResult, ...]
    expert: tuple[EpisodeResult, ...]
    blind: tuple[EpisodeResult, ...]
    training_seconds: float
    machine: Machine
    versions: dict[str, str]
    date: str

    def __post_init__(self) -> None:
        seeds = [episode.seed for episode in self.episodes]
        for name, holds, rule in (
            ("schema_version", self.schema_version == ROW_SCHEMA_VERSION, f"must be {ROW_SCHEMA_VERSION}"),
            (
                "checkpoint_sha256",
                re.fullmatch("[0-9a-f]{64}", self.checkpoint_sha256),
                "must be 64 hex digits",
            ),
            ("split", self.split in ("train", "val", "test"), "must be one of: train, val, test"),
            ("training_seconds", self.training_seconds >= 0, "must not be negative"),
            ("date", re.fullmatch(r"\d{4}-\d\d-\d\d", self.date), "must be a day, YYYY-MM-DD"),
            ("episodes", seeds and len(set(seeds)) == len(seeds), "must not be empty nor repeat a seed"),
            (
                "flags",
                all(self.flags.get(name, "").isdecimal() for name in NUMBERS),
                f"must hold the numbers {', '.join(NUMBERS)}",
            ),
            (
                "checkpoint_step",
                str(self.checkpoint_step) in self._candidates,
                "must be among the validated steps, or the last one if none was validated",
            ),
        ):
            if not holds:
                raise ValueError(f"field {name!r} is {getattr(self, name)!r}, but {rule}")

    @property
    def _candidates(self) -> set[str | None]:
        return {str(validation.step) for validation in self.validation} or {self.flags.get("steps")}

    @property
    def rates(self) -> dict[str, SuccessRate]:
        """Success of policy, expert and blind control."""
        played = {"policy": self.episodes, "expert": self.expert, "blind": self.blind}
        return {who: success_rate(episodes) for who, episodes in played.items()}

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
        row = _decode(cls, content, "result")
        if rates != _rates_as_json(row):
            raise BadResult(f"field {RATES!r} is {rates!r}, but the episodes give {_rates_as_json(row)!r}")
        return row

    @classmethod
    def read(cls, path: Path) -> Self:
        """The row in a file.

        Raises:
            BadResult: the file cannot be read, or as in `from_json`.
        """
        try:
            return cls.from_json(path.read_bytes())
        except (OSError, BadResult) as error:
            raise BadResult(f"{path}: {error}") from error


def success_rate(episodes: tuple[EpisodeResult, ...]) -> SuccessRate:
    """Successes among episodes."""
    return SuccessRate(sum(episode.success for episode in episodes), len(episodes))


def read_evaluation(path: Path, first_seed: int) -> tuple[EpisodeResult, ...]:
    """Episodes of a `lerobot-eval` result of one task; LeRobot counts seeds up from the first, without listing them.

    Raises:
        BadResult: the file is no such result, or the evaluation was of several tasks.
    """
    with _reading(path):
        tasks = read_json(path)["per_task"]
        if len(tasks) != 1:
            raise BadResult(f"{path} holds {len(tasks)} tasks, but must hold one; choose a single --task")
        successes = tasks[0]["metrics"]["successes"]
        return tuple(
            EpisodeResult(first_seed + index, bool(success)) for index, success in enumerate(successes)
        )


def read_certificate(path: Path) -> tuple[EpisodeResult, ...]:
    """Episodes of a `lerobot-bimanual certify` result of one task.

    Raises:
        BadResult: the file is no such result, or the certificate is of several tasks.
    """
    with _reading(path):
        episodes = read_json(path)["episodes"]
        if len(tasks := {episode["task"] for episode in episodes}) != 1:
            raise BadResult(
                f"{path} holds the tasks {sorted(tasks)}, but must hold one; choose a single --task"
            )
        return tuple(
            EpisodeResult(
                seed=episode["seed"],
                success=bool(episode["success"]),
                variation=episode["variation"],
                failure=episode["failure"] or None,
                state_hash=episode["state_hash"],
            )
            for episode in episodes
        )


def read_world(path: Path, task: str) -> str:
    """Version of a task's world, from a certificate of that task.

    Raises:
        BadResult: the certificate does not tell.
    """
    with _reading(path):
        return str(read_json(path)["worlds"][task])


def versions() -> dict[str, str]:
    """Versions of the installed packages that a result depends on, and of Python."""
    found = installed_versions(RESULT_PACKAGES)
    # LeRobot's own policies do without ours.
    present = {package: version for package, version in found.items() if version != "none"}
    return {"python": platform.python_version()} | present


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Say of a file of another form that it is one."""
    try:
        yield
    except (LookupError, TypeError) as error:
        raise BadResult(f"{path} is not of the form that its program writes: {error!r}") from error


def _rates_as_json(row: ResultRow) -> dict[str, dict[str, Any]]:
    return {
        who: {"successes": rate.successes, "trials": rate.trials, "wilson_95": list(rate.interval)}
        for who, rate in row.rates.items()
    }


def _decode(kind: Any, value: Any, place: str) -> Any:
    """A JSON value as an annotation wants it; nothing is converted but lists to tuples and integers to floats."""
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is types.UnionType:
        return None if value is None else _decode(inner[0], value, place)
    if origin is tuple:
        items = _expect(list, value, place)
        return tuple(_decode(inner[0], item, f"{place}[{index}]") for index, item in enumerate(items))
    if origin is dict:
        items = _expect(dict, value, place)
        return {key: _decode(inner[1], item, f"{place}.{key}") for key, item in items.items()}
    if is_dataclass(kind):
        return _decode_fields(kind, _expect(dict, value, place), place)
    if kind is float and type(value) is int:
        return float(value)
    return _expect(kind, value, place)


def _decode_fields(kind: Any, content: Mapping[str, Any], place: str) -> Any:
    hints = typing.get_type_hints(kind)
    names = [field.name for field in fields(kind)]
    for wrong, problem in ((set(names) - set(content), "lacks"), (set(content) - set(names), "has unknown")):
        if wrong:
            raise BadResult(
                f"{place} {problem} {', '.join(sorted(wrong))}; its fields are {', '.join(names)}"
            )
    values = {name: _decode(hints[name], content[name], f"{place}.{name}") for name in names}
    try:
        return kind(**values)
    except ValueError as error:
        raise BadResult(str(error)) from error


def _expect(kind: type, value: Any, place: str) -> Any:
    if type(value) is not kind:
        raise BadResult(f"{place} is {value!r}, but must be a {kind.__name__}")
    return value
