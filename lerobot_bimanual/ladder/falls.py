"""What a rung costs a policy: the same episodes there and in the world as it is."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from lerobot_bimanual.benchmark.pairing import Pairing
from lerobot_bimanual.ladder.result import LadderResult, Rung
from lerobot_bimanual.results.statistics import SuccessRate, holm


@dataclass(frozen=True)
class Fall:
    """A rung held against level 0.

    Attributes:
        rung: where the policy was played.
        pairing: outcomes at level 0, first, and on the rung.
        p_holm: McNemar's exact p-value, two-sided, corrected by Holm for how many axes have a certified rung of this level;
            None where the rung is not certified.
    """

    rung: Rung
    pairing: Pairing
    p_holm: float | None

    @property
    def difference(self) -> float:
        """Success on the rung less success at level 0."""
        return (self.pairing.only_second - self.pairing.only_first) / len(self.rung.episodes)

    @property
    def p_value(self) -> float:
        """Of McNemar's exact test, before the correction."""
        return self.pairing.p_value


def falls(result: LadderResult) -> dict[str, Fall]:
    """Every rung but level 0 held against it, by name."""
    pairings = {
        rung.name: Pairing.of(result.level_0.solved, rung.solved) for rung in result.rungs if rung.level
    }
    corrected = corrected_by_level(
        (rung for rung in result.rungs if rung.level and rung.is_certified), pairings
    )
    return {
        name: Fall(result.by_name[name], pairing, corrected.get(name)) for name, pairing in pairings.items()
    }


def corrected_by_level(rungs: Iterable[Rung], pairings: Mapping[str, Pairing]) -> dict[str, float]:
    """McNemar's exact p-values, corrected by Holm for how many of these rungs are of the same level.

    Args:
        rungs: certified ones; of no other is there anything to say.
        pairings: of these rungs and perhaps others, by name.

    Returns:
        By the names of the rungs.
    """
    by_level: defaultdict[int, list[str]] = defaultdict(list)
    for rung in rungs:
        by_level[rung.level].append(rung.name)
    corrected: dict[str, float] = {}
    for names in by_level.values():
        corrected |= zip(names, holm([pairings[name].p_value for name in names]), strict=True)
    return corrected


def level_sums(result: LadderResult) -> dict[int, SuccessRate]:
    """Success over the certified rungs of each level; a level without one is left out."""
    sums: dict[int, SuccessRate] = {}
    for rung in result.rungs:
        if rung.is_certified:
            rate, before = rung.rates["policy"], sums.get(rung.level, SuccessRate(0, 0))
            sums[rung.level] = SuccessRate(before.successes + rate.successes, before.trials + rate.trials)
    return sums
