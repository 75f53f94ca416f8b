"""Are two policies different, seed by seed?"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import lcm, sqrt

from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.statistics import (
    SuccessRate,
    anytime_p_value,
    mcnemar_p_value,
    sign_flip_p_value,
    standard_deviation,
)
from lerobot_bimanual.versions import SIMULATION_PACKAGES


@dataclass(frozen=True)
class Pairing:
    """Outcomes of two policies on the same episodes.

    Attributes:
        both: episodes that both solved.
        only_first: episodes that only the first solved.
        only_second: episodes that only the second solved.
        neither: episodes that none solved.
    """

    both: int
    only_first: int
    only_second: int
    neither: int

    @classmethod
    def of(cls, first: Sequence[bool], second: Sequence[bool]) -> "Pairing":
        """The pairing of two lists of success, one entry per episode."""
        outcomes = list(zip(first, second, strict=True))
        return cls(
            both=outcomes.count((True, True)),
            only_first=outcomes.count((True, False)),
            only_second=outcomes.count((False, True)),
            neither=outcomes.count((False, False)),
        )

    @property
    def p_value(self) -> float:
        """Of McNemar's exact test, two-sided."""
        return mcnemar_p_value(self.only_first, self.only_second)


@dataclass(frozen=True)
class Comparison:
    """Two policies on one task, each trained once or several times.

    Attributes:
        first: trainings of the first, by seed of the training.
        second: trainings of the second.

    Raises:
        BimanualError: the rows differ in task, world, variation or simulation, share no seed, or are of several trainings
            where a test went on only until it was sure.
    """

    first: tuple[ResultRow, ...]
    second: tuple[ResultRow, ...]

    def __post_init__(self) -> None:
        rows = (*self.first, *self.second)
        for row in rows:
            _check_likeness(rows[0], row)
        if not self.seeds:
            raise BimanualError("the results share no seed; evaluate both on the same --first_seed")
        if self.was_stopped and self.trained_often:
            raise BimanualError(
                f"a test with --stop_when_sure compares one training with one, but here are {len(self.first)} and "
                f"{len(self.second)} on {rows[0].place}; compare two files, or leave the stopped ones out"
            )

    @cached_property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the episodes that all trainings have played."""
        played = [{episode.seed for episode in row.episodes} for row in (*self.first, *self.second)]
        return tuple(sorted(set.intersection(*played)))

    @property
    def rates(self) -> tuple[list[SuccessRate], list[SuccessRate]]:
        """Success of every training on those seeds."""
        first, second = self._outcomes
        return [_rate(solved) for solved in first], [_rate(solved) for solved in second]

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
    def was_stopped(self) -> bool:
        """Whether a test went on only until it was sure."""
        return any(row.stopped_against is not None for row in (*self.first, *self.second))

    @property
    def test(self) -> str:
        """What gives the p-value."""
        if self.was_stopped:
            return "a test that may be looked at any time"
        return "the exact sign-flip permutation test" if self.trained_often else "McNemar's exact test"

    @property
    def p_value(self) -> float:
        """Of that test, two-sided.

        Trainings play the same episodes, and what is hard for one is hard for the others. So an episode counts once,
        with the mean over its trainings; for one training of each that is McNemar's test.
        """
        return anytime_p_value(*self.better) if self.was_stopped else sign_flip_p_value(self._differences)

    @property
    def difference(self) -> float:
        """Mean success of the first less that of the second."""
        first, second = self.rates
        return _mean([rate.rate for rate in first]) - _mean([rate.rate for rate in second])

    @property
    def episode_error(self) -> float:
        """Standard error of the difference that comes of which episodes were drawn, for these very trainings."""
        return standard_deviation(self._differences) / self._unit / sqrt(len(self.seeds))

    @property
    def training_error(self) -> float | None:
        """Standard error of the difference that comes of which trainings there were; None if either has only one."""
        first, second = ([rate.rate for rate in rates] for rates in self.rates)
        if len(first) < 2 or len(second) < 2:
            return None
        return sqrt(
            standard_deviation(first) ** 2 / len(first) + standard_deviation(second) ** 2 / len(second)
        )

    @property
    def _unit(self) -> int:
        """Into how many parts a success is divided so that shares of either's trainings are integers."""
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
        return [self._solved(row) for row in self.first], [self._solved(row) for row in self.second]

    def _solved(self, row: ResultRow) -> list[bool]:
        success = {episode.seed: episode.success for episode in row.episodes}
        return [success[seed] for seed in self.seeds]


def _rate(solved: Sequence[bool]) -> SuccessRate:
    return SuccessRate(sum(solved), len(solved))


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def _check_likeness(first: ResultRow, second: ResultRow) -> None:
    for name in ("task", "variation"):
        one, other = getattr(first, name), getattr(second, name)
        if one != other:
            raise BimanualError(
                f"the results differ in {name}: {one!r} and {other!r}; compare like with like"
            )
    if first.world != second.world:
        raise BimanualError(
            f"{first.task} was another task for each: world {first.world} for one result and {second.world} for the "
            "other; evaluate both with the same version of lerobot_env_bimanual"
        )
    for package in SIMULATION_PACKAGES:
        one, other = first.versions.get(package), second.versions.get(package)
        if one != other:
            raise BimanualError(
                f"{package} was {one} for one result and {other} for the other, so a seed may mean two episodes; "
                "evaluate both with the same versions"
            )
