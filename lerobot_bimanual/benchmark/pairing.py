"""Are two policies different, seed by seed?"""

from dataclasses import dataclass
from math import comb

from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.dataset.provenance import SIMULATION_PACKAGES
from lerobot_bimanual.errors import BimanualError


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

    @property
    def p_value(self) -> float:
        """Two-sided exact test of McNemar (1947).

        If the policies were equally good, an episode that only one of them solves would be either's with
        probability one half; this is the probability of a split at least as uneven as the one seen.
        """
        differing = self.only_first + self.only_second
        tail = sum(comb(differing, k) for k in range(min(self.only_first, self.only_second) + 1))
        return min(1.0, 2 * tail / 2**differing)


def pair(first: ResultRow, second: ResultRow) -> Pairing:
    """Count the outcomes of two rows on the seeds that they share.

    Raises:
        BimanualError: the rows differ in task, world, variation or simulation, or share no seed.
    """
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
    successes = {episode.seed: episode.success for episode in second.episodes}
    outcomes = [
        (episode.success, successes[episode.seed]) for episode in first.episodes if episode.seed in successes
    ]
    if not outcomes:
        raise BimanualError("the results share no seed; evaluate both on the same --first_seed")
    return Pairing(
        both=outcomes.count((True, True)),
        only_first=outcomes.count((True, False)),
        only_second=outcomes.count((False, True)),
        neither=outcomes.count((False, False)),
    )
