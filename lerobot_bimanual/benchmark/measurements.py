"""What the programs of a benchmark have measured, read from their files and held against what was asked of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lerobot_bimanual.benchmark.episode_result import EpisodeResult
from lerobot_bimanual.benchmark.results import BadResult
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.evaluation.record import EvaluationRecord
from lerobot_bimanual.json_file import read_json, shown
from lerobot_bimanual.json_record import BadRecord, decode


@dataclass(frozen=True)
class _Metrics:
    successes: tuple[bool, ...]


@dataclass(frozen=True)
class _TaskResult:
    metrics: _Metrics


@dataclass(frozen=True)
class _Evaluation:
    """What is read of `lerobot-eval`'s `eval_info.json`."""

    per_task: tuple[_TaskResult, ...]


@dataclass(frozen=True)
class _Episode:
    task: str
    variation: int
    seed: int
    success: bool
    failure: str
    state_hash: str


@dataclass(frozen=True)
class _Certificate:
    """What is read of a certificate."""

    control: str
    discretise: int
    split: str
    worlds: dict[str, str]
    episodes: tuple[_Episode, ...]


@dataclass(frozen=True)
class _Worlds:
    worlds: dict[str, str]


@dataclass(frozen=True)
class Certified:
    """A certificate of one task.

    Attributes:
        world: version of the task's world.
        episodes: one per seed, or one per seed and variation.
    """

    world: str
    episodes: tuple[EpisodeResult, ...]


def read_evaluation(path: Path, seeds: Sequence[int]) -> tuple[EpisodeResult, ...]:
    """Episodes of a `lerobot-eval` result of one task.

    Args:
        path: the file.
        seeds: of its episodes; LeRobot counts them up from the first, without listing them.

    Raises:
        BadResult: the file is no such result, or the evaluation was of several tasks or another number of episodes.
    """
    tasks = _read(_Evaluation, path).per_task
    if len(tasks) != 1:
        raise BadResult(f"{path} holds {len(tasks)} tasks, but must hold one; choose a single --task")
    successes = tasks[0].metrics.successes
    if len(successes) != len(seeds):
        raise BadResult(f"{path} holds {len(successes)} episodes, but {len(seeds)} were asked for")
    return tuple(EpisodeResult(seed, success) for seed, success in zip(seeds, successes, strict=True))


def read_record(path: Path, seeds: Sequence[int]) -> EvaluationRecord:
    """The record of an evaluation, without the episodes that filled up its last batch.

    Args:
        path: the file.
        seeds: of the episodes that were asked for, rising.

    Raises:
        BadResult: the file is no such record, or an episode is missing.
    """
    try:
        record = EvaluationRecord.read(path)
    except BimanualError as error:
        raise BadResult(str(error)) from error
    episodes = tuple(episode for episode in record.episodes if episode.seed in seeds)
    if [episode.seed for episode in episodes] != list(seeds):
        raise BadResult(f"{path} does not hold the seeds {shown(seeds)}; remove it to evaluate anew")
    return replace(record, episodes=episodes)


def check_agreement(record: EvaluationRecord, evaluation: Sequence[EpisodeResult]) -> None:
    """LeRobot and the environment must say the same of the same episodes, one by one.

    Raises:
        BadResult: they do not.
    """
    for played, counted in zip(record.episodes, evaluation, strict=True):
        if (played.seed, played.success) != (counted.seed, counted.success):
            raise BadResult(
                f"seed {played.seed} of {record.task} has success {played.success} in the environment's record, but "
                f"lerobot-eval counted seed {counted.seed} with success {counted.success}"
            )


def read_certificate(path: Path, control: str, task: str, seeds: Sequence[int]) -> Certified:
    """Episodes of a `lerobot-bimanual expert evaluate` result of one task on the split `test`.

    Raises:
        BadResult: the file is no such result, or of another control, split, task or other seeds.
    """
    certificate = _read(_Certificate, path)
    for name, got, wanted in (
        ("control", certificate.control, control),
        ("discretise", certificate.discretise, 0),
        ("split", certificate.split, "test"),
        ("tasks", sorted({episode.task for episode in certificate.episodes}), [task]),
        ("tasks of worlds", sorted(certificate.worlds), [task]),
        ("seeds", sorted({episode.seed for episode in certificate.episodes}), list(seeds)),
    ):
        if got != wanted:
            raise BadResult(
                f"{path}: {name} is {shown(got)}, but {shown(wanted)} was asked for; remove the file to measure anew"
            )
    return Certified(
        certificate.worlds[task],
        tuple(
            EpisodeResult(
                seed=episode.seed,
                success=episode.success,
                variation=episode.variation,
                failure=episode.failure or None,
                state_hash=episode.state_hash,
            )
            for episode in certificate.episodes
        ),
    )


def read_worlds(path: Path) -> dict[str, str]:
    """Version of each task's world in a certificate.

    Raises:
        BadResult: the file is no certificate.
    """
    return _read(_Worlds, path).worlds


def _read[Kind](kind: type[Kind], path: Path) -> Kind:
    try:
        value: Any = read_json(path)
    except BimanualError as error:
        raise BadResult(str(error)) from error
    try:
        return decode(kind, value, "the file", partly=True)
    except BadRecord as error:
        raise BadResult(f"{path} is not of the form that its program writes: {error}") from error
