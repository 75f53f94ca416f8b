"""Paired comparison of two policies on the same episodes, and what results must share to be compared."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import lcm, sqrt
from pathlib import Path
from statistics import fmean, stdev

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.episode import Episode
from lerobot_bimanual.results.statistics import (
    Pairing,
    SuccessRate,
    sign_flip_p_value,
)
from lerobot_bimanual.versions import SIMULATION_PACKAGES

type Results = Mapping[Path, BenchmarkResult]

DATASET_NAMES = ("repo_id",)
"""Settings of demonstrations that do not decide their content."""


@dataclass(frozen=True)
class Comparison:
    """Two policies on one task, each trained once or several times.

    Attributes:
        first: trainings of the first, by seed of the training.
        second: trainings of the second.

    Raises:
        BimanualError: the results differ in task, variation, world or simulation, or share no seed.
    """

    first: tuple[BenchmarkResult, ...]
    second: tuple[BenchmarkResult, ...]

    def __post_init__(self) -> None:
        results = (*self.first, *self.second)
        for result in results:
            _check_same_episodes(results[0], result)
        if not self.seeds:
            raise BimanualError("the results share no seed; evaluate both on the same --first_seed")

    @cached_property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the episodes that all trainings were tested on."""
        played = [{episode.seed for episode in result.episodes} for result in (*self.first, *self.second)]
        return tuple(sorted(set.intersection(*played)))

    @property
    def rates(self) -> tuple[list[SuccessRate], list[SuccessRate]]:
        """Success of every training on those seeds."""
        first, second = self._outcomes
        return [*map(_rate, first)], [*map(_rate, second)]

    @property
    def pairing(self) -> Pairing | None:
        """Outcomes on the same episodes; None if either was trained several times, so that one has several."""
        (first, *_), (second, *_) = self._outcomes
        return None if self.trained_often else Pairing.of(first, second)

    @property
    def better(self) -> tuple[int, int]:
        """Number of episodes that the first solves more often than the second, in shares of its trainings, and the reverse."""
        differences = self._differences
        return sum(value > 0 for value in differences), sum(value < 0 for value in differences)

    @property
    def trained_often(self) -> bool:
        """Whether either was trained several times."""
        return max(len(self.first), len(self.second)) > 1

    @property
    def test(self) -> str:
        """Name of the test that gives the p-value."""
        return "the exact sign-flip permutation test" if self.trained_often else "McNemar's exact test"

    @property
    def p_value(self) -> float:
        """Two-sided p-value of that test.

        Trainings are tested on the same episodes, and what is hard for one is hard for the others. So an episode counts
        once, with the mean over its trainings; for one training of each that is McNemar's test.
        """
        return sign_flip_p_value(self._differences)

    @property
    def difference(self) -> float:
        """Mean success of the first less that of the second."""
        first, second = self.rates
        return fmean([rate.rate for rate in first]) - fmean([rate.rate for rate in second])

    @property
    def episode_error(self) -> float:
        """Standard error of the difference from the draw of the episodes, for these trainings."""
        return _deviation(self._differences) / self._unit / sqrt(len(self.seeds))

    @property
    def training_error(self) -> float | None:
        """Standard error of the difference from the draw of the trainings; None if either has only one."""
        first, second = ([rate.rate for rate in rates] for rates in self.rates)
        if len(first) < 2 or len(second) < 2:
            return None
        return sqrt(_deviation(first) ** 2 / len(first) + _deviation(second) ** 2 / len(second))

    @property
    def _unit(self) -> int:
        """Number of parts of a success for which the mean over either's trainings is an integer."""
        return lcm(len(self.first), len(self.second))

    @cached_property
    def _differences(self) -> list[int]:
        """By episode, mean success of the first less that of the second, in those parts."""
        first, second = (
            [sum(solved) * self._unit // len(solved) for solved in zip(*outcomes, strict=True)]
            for outcomes in self._outcomes
        )
        return [one - other for one, other in zip(first, second, strict=True)]

    @cached_property
    def _outcomes(self) -> tuple[list[list[bool]], list[list[bool]]]:
        """Of each training, success on every shared seed."""
        return [*map(self._solved, self.first)], [*map(self._solved, self.second)]

    def _solved(self, result: BenchmarkResult) -> list[bool]:
        success = {episode.seed: episode.success for episode in result.episodes}
        return [success[seed] for seed in self.seeds]


def _rate(solved: Sequence[bool]) -> SuccessRate:
    return SuccessRate(sum(solved), len(solved))


def _deviation(values: Sequence[float]) -> float:
    """Standard deviation of a sample; 0 for a single value."""
    return stdev(values) if len(values) > 1 else 0.0


def check_comparable(results: Results) -> None:
    """Results of one table share recipe and simulation; those of one line also world, expert and baseline.

    Raises:
        BimanualError: they do not, or trainings of one policy differ; the message names both files.
    """
    _check_equal(results, _facts_of_table)
    check_trainings(results)


def check_trainings(results: Results) -> None:
    """Trainings of one policy are of one recipe; those for one line differ in weights and seed, and in nothing else.

    Raises:
        BimanualError: they differ in something else, or have the same weights; the message names both files.
    """
    _check_equal(results, _facts_of_training)
    first: dict[tuple[str, str, str], Path] = {}
    for path, result in results.items():
        key = (result.config.eval_key, result.config.policy_id, result.checkpoint_sha256)
        if (other := first.setdefault(key, path)) != path:
            raise BimanualError(
                f"{path} has the weights of {other}, so it is not another training; remove one of the files"
            )


def _check_equal(results: Results, facts: Callable[[BenchmarkResult], Mapping[str, object]]) -> None:
    first: dict[str, tuple[Path, object]] = {}
    for path, result in results.items():
        for name, value in facts(result).items():
            elsewhere, other = first.setdefault(name, (path, value))
            if value != other:
                raise BimanualError(
                    f"{path}: {name} is {value!r:.200}, but {other!r:.200} in {elsewhere}; results are not comparable; "
                    "remove one of the files"
                )


def _facts_of_table(result: BenchmarkResult) -> dict[str, object]:
    key = result.config.eval_key
    return {
        "recipe": result.config.recipe,
        "versions": {package: result.versions[package] for package in SIMULATION_PACKAGES},
        f"world of {result.task}, {key}": result.world,
        f"expert on {key}": _outcomes(result.expert),
        f"open-loop baseline on {key}": _outcomes(result.open_loop),
    }


def _facts_of_training(result: BenchmarkResult) -> dict[str, object]:
    config, settings = result.config, result.demonstrations.settings
    measured = config.model_dump(exclude={"seed", "training"}) | config.training
    demonstrated = {name: value for name, value in settings.items() if name not in DATASET_NAMES}
    facts: dict[str, object] = {f"recipe of {config.policy_id}": config.recipe}
    for kind, options in (
        ("setting", measured),
        ("demonstrations' setting", demonstrated),
        ("test's option", result.options),
    ):
        of = f"of {config.policy_id} on {config.eval_key}"
        facts[f"{kind}s {of}"] = sorted(options)
        facts |= {f"{kind} {name} {of}": value for name, value in options.items()}
    return facts


def _outcomes(episodes: Sequence[Episode]) -> list[tuple[int, int | None, bool]]:
    """What does not depend on the processor."""
    return [(episode.seed, episode.variation, episode.success) for episode in episodes]


def _check_same_episodes(first: BenchmarkResult, second: BenchmarkResult) -> None:
    one, other = (
        {"task": result.task, "variation": result.config.variation, f"world of {result.task}": result.world}
        | {f"version of {package}": result.versions[package] for package in SIMULATION_PACKAGES}
        for result in (first, second)
    )
    for name in one:
        if one[name] != other.get(name):
            raise BimanualError(
                f"the results differ in {name}: {one[name]!r} and {other.get(name)!r}, so a seed may mean two episodes; "
                "evaluate both on the same task with the same versions"
            )
