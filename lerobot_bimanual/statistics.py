"""How sure one can be of a success rate."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from statistics import NormalDist


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
        """Share of successes, 0 when nothing was tried."""
        return self.successes / self.trials if self.trials else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson score interval at 95 % confidence."""
        return wilson_interval(self.successes, self.trials)

    def __str__(self) -> str:
        lower, upper = self.interval
        return f"{self.successes}/{self.trials} ({lower:.1%} to {upper:.1%})"


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Wilson score interval of a proportion at 95 % confidence (Wilson 1927).

    Unlike the normal approximation it keeps its coverage near 0 and 1, where certified experts live.

    Args:
        successes: number of successes, 0 to `trials`.
        trials: number of independent episodes.

    Returns:
        Lower and upper bound in [0, 1]; (0, 1) when nothing was tried.

    Raises:
        ValueError: a count is out of range.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"need 0 <= successes <= trials, got {successes} of {trials}")
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
