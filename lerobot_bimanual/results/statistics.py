"""Intervals of success rates, and tests of paired outcomes."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb, sqrt
from statistics import NormalDist

import numpy as np


@dataclass(frozen=True)
class SuccessRate:
    """Successes among independent episodes.

    Raises:
        ValueError: not `0 <= successes <= trials`.
    """

    successes: int
    trials: int

    def __post_init__(self) -> None:
        if not 0 <= self.successes <= self.trials:
            raise ValueError(f"need 0 <= successes <= trials, got {self.successes} of {self.trials}")

    @property
    def rate(self) -> float:
        """Share of successes, 0 without trials."""
        return self.successes / self.trials if self.trials else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson score interval at 95 % confidence."""
        return wilson_interval(self.successes, self.trials)

    def __str__(self) -> str:
        lower, upper = self.interval
        return f"{self.successes}/{self.trials} ({lower:.1%} to {upper:.1%})"


def wilson_interval(successes: float, trials: int) -> tuple[float, float]:
    """Wilson score interval of a proportion at 95 % confidence (Wilson 1927).

    Unlike the normal approximation it keeps its coverage near 0 and 1, where experts are.

    Args:
        successes: number of successes, 0 to `trials`; may be the mean of several trainings on the same episodes.
        trials: number of independent episodes.

    Returns:
        Lower and upper bound in [0, 1]; (0, 1) without trials.
    """
    if trials == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.975)
    rate = successes / trials
    scale = 1 + z * z / trials
    center = (rate + z * z / (2 * trials)) / scale
    half_width = z / scale * sqrt(rate * (1 - rate) / trials + z * z / (4 * trials * trials))
    # Both bounds are exact at the ends, but rounding may leave them off by an ulp.
    lower = 0.0 if successes == 0 else center - half_width
    upper = 1.0 if successes == trials else center + half_width
    return lower, upper


def paired_p_value(first: Sequence[int], second: Sequence[int], trainings: tuple[int, int] = (1, 1)) -> float:
    """Two-sided p-value of paired successes: the larger of two exact permutation tests, each of which alone may be too small.

    It is the probability of mean successes at least as different as those seen, if the policies were equally good. The one
    test takes episodes for the sample: the difference of each has either sign (Fisher 1935), however alike the trainings of
    a policy are. The other deals out the successes of each episode among all trainings (Pitman 1937), which holds for
    unequal numbers of them, too. With one training of each, both are the exact test of McNemar (1947).

    Args:
        first: successes of the trainings of the first policy, one number per episode.
        second: those of the second, on the same episodes.
        trainings: number of trainings of either.
    """
    n, m = trainings
    total, largest = 0, n * m  # of the difference between the means of an episode, in parts of 1 / (n m)
    flipped, dealt = np.ones(1), np.ones(1)  # chances of each sum over the episodes so far
    for a, b in zip(first, second, strict=True):
        total += (difference := m * a - n * b)
        signs, deals = np.zeros((2, 2 * largest + 1))
        for each in (difference, -difference):
            signs[largest + each] += 0.5
        for k in range(max(0, a + b - m), min(n, a + b) + 1):  # hypergeometric
            ways = comb(a + b, k) * comb(n + m - a - b, n - k)
            deals[largest + m * k - n * (a + b - k)] = ways / comb(n + m, n)
        flipped, dealt = np.convolve(flipped, signs), np.convolve(dealt, deals)
    is_as_different = abs(np.arange(len(dealt)) - len(dealt) // 2) >= abs(total)
    return min(1.0, max(float(chances[is_as_different].sum()) for chances in (flipped, dealt)))


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values corrected for multiple testing (Holm 1979), in the order given.

    Rejecting those of at most 0.05 keeps the family-wise error rate at or below 5 %.
    """
    given = np.array(p_values, dtype=float)
    order, corrected = np.argsort(given), np.empty_like(given)
    times = np.arange(len(given), 0, -1)
    corrected[order] = np.maximum.accumulate(np.minimum(1.0, times * given[order]))
    return corrected.tolist()
