"""What a rung costs a policy: the same episodes there and in the world as it is."""

from collections import defaultdict
from dataclasses import dataclass

from lerobot_bimanual.benchmark.pairing import Pairing
from lerobot_bimanual.ladder.result import LadderResult, Rung
from lerobot_bimanual.statistics import SuccessRate, holm, mcnemar_p_value


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
        return mcnemar_p_value(self.pairing.only_first, self.pairing.only_second)


def falls(result: LadderResult) -> dict[str, Fall]:
    """Every rung but level 0 held against it, by name."""
    pairings = {
        rung.name: Pairing.of(result.level_0.solved, rung.solved) for rung in result.rungs if rung.level
    }
    by_level: defaultdict[int, list[str]] = defaultdict(list)
    for name in pairings:
        if (rung := result.by_name[name]).is_certified:
            by_level[rung.level].append(name)
    corrected: dict[str, float] = {}
    for names in by_level.values():
        p_values = [mcnemar_p_value(pairings[name].only_first, pairings[name].only_second) for name in names]
        corrected |= zip(names, holm(p_values), strict=True)
    return {
        name: Fall(result.by_name[name], pairing, corrected.get(name)) for name, pairing in pairings.items()
    }


def level_sums(result: LadderResult) -> dict[int, SuccessRate]:
    """Success over the certified rungs of each level; a level without one is left out."""
    sums: dict[int, SuccessRate] = {}
    for rung in result.rungs:
        if rung.is_certified:
            rate, before = rung.rates["policy"], sums.get(rung.level, SuccessRate(0, 0))
            sums[rung.level] = SuccessRate(before.successes + rate.successes, before.trials + rate.trials)
    return sums
