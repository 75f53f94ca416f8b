"""What a condition costs a policy: success on the same episodes there and in the nominal world, and its tables."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from lerobot_bimanual.results.robustness import PolicyCondition, RobustnessResult
from lerobot_bimanual.results.statistics import Pairing, SuccessRate, holm
from lerobot_bimanual.tables import print_table

SIGNIFICANT = 0.05
"""Corrected p-values up to this one count as a difference."""
HEADINGS = (
    "condition",
    "magnitude",
    "policy",
    "95 % interval",
    "expert",
    "open loop",
    "lost, won",
    "p",
    "p (Holm)",
)


@dataclass(frozen=True)
class Drop:
    """A condition beside the nominal world.

    Attributes:
        condition: the condition.
        pairing: outcomes in the nominal world, first, and on the condition.
        p_holm: McNemar's exact p-value, two-sided, corrected by Holm for the number of axes with a valid condition of this
            level; None if the condition is not valid.
    """

    condition: PolicyCondition
    pairing: Pairing
    p_holm: float | None

    @property
    def difference(self) -> float:
        """Success on the condition less nominal success."""
        return (self.pairing.only_second - self.pairing.only_first) / len(self.condition.episodes)

    @property
    def is_significant(self) -> bool:
        """Whether the corrected p-value is small enough."""
        return self.p_holm is not None and self.p_holm <= SIGNIFICANT


def drops_of(result: RobustnessResult) -> dict[str, Drop]:
    """Every condition beside the nominal world, by name."""
    pairings = {
        condition.name: Pairing.of(result.nominal.solved, condition.solved)
        for condition in result.conditions
        if condition.level
    }
    corrected = corrected_by_level(
        (condition for condition in result.conditions if condition.level and condition.is_valid), pairings
    )
    return {
        name: Drop(result.by_name[name], pairing, corrected.get(name)) for name, pairing in pairings.items()
    }


def corrected_by_level(
    conditions: Iterable[PolicyCondition], pairings: Mapping[str, Pairing]
) -> dict[str, float]:
    """McNemar's exact p-values, corrected by Holm for the number of conditions of the same level.

    Args:
        conditions: valid conditions.
        pairings: of these conditions and perhaps others, by name.

    Returns:
        By the names of the conditions.
    """
    by_level: defaultdict[int, list[str]] = defaultdict(list)
    for condition in conditions:
        by_level[condition.level].append(condition.name)
    corrected: dict[str, float] = {}
    for names in by_level.values():
        corrected |= zip(names, holm([pairings[name].p_value for name in names]), strict=True)
    return corrected


def level_sums(result: RobustnessResult) -> dict[int, SuccessRate]:
    """Success over the valid conditions of each level; a level without one is left out."""
    sums: dict[int, SuccessRate] = {}
    for condition in result.conditions:
        if condition.is_valid:
            rate, before = condition.rates["policy"], sums.get(condition.level, SuccessRate(0, 0))
            sums[condition.level] = SuccessRate(
                before.successes + rate.successes, before.trials + rate.trials
            )
    return sums


def print_drops(result: RobustnessResult) -> None:
    """Print one line per condition; lost and won are the episodes solved only in the nominal world, and only there."""
    rows = []
    found, axes = drops_of(result), {axis.name: axis for axis in result.axes}
    for condition in result.conditions:
        rates, axis, drop = condition.rates, axes.get(condition.axis), found.get(condition.name)
        low, high = rates["policy"].interval
        paired = ("", "", "")
        if drop is not None:
            p_holm = "not valid" if drop.p_holm is None else f"{drop.p_holm:.3g}"
            changed = f"{drop.pairing.only_first}, {drop.pairing.only_second}"
            paired = (changed, f"{drop.pairing.p_value:.3g}", p_holm)
        rows.append(
            (
                condition.name,
                "" if axis is None else f"{axis.magnitudes[condition.level - 1]:g}",
                rates["policy"].successes,
                f"{low:.0%} to {high:.0%}",
                rates["expert"].successes,
                rates["open_loop"].successes,
                *paired,
            )
        )
    title = f"{result.policy} on {result.task}, the same {len(result.nominal.episodes)} episodes"
    print_table(HEADINGS, rows, title)


def remarks(result: RobustnessResult) -> Iterator[str]:
    """Sums over valid conditions, and what is in no sum."""
    said = (f"level {level}: {rate.successes} of {rate.trials}" for level, rate in level_sums(result).items())
    yield f"valid conditions together: {'; '.join(said) or 'none'}"
    if invalid := [condition.name for condition in result.conditions if not condition.is_valid]:
        yield f"not valid, since the expert solves too few, and in no sum: {', '.join(invalid)}"
    if result.not_applicable:
        yield f"not applicable to {result.task}: {', '.join(result.not_applicable)}"
