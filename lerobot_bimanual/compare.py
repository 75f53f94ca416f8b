"""The `compare` verb: are two policies different, seed by seed?"""

from dataclasses import dataclass, field
from math import comb
from pathlib import Path

from rich.console import Console
from rich.table import Table

from lerobot_bimanual.dataset.provenance import SIMULATION_PACKAGES
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results import ResultRow, success_rate


@dataclass
class CompareConfig:
    """Flags of the `compare` verb."""

    first: Path = field(kw_only=True)  # result of one benchmark, a JSON file
    second: Path = field(kw_only=True)  # result of another one on the same task, variation and split


@dataclass(frozen=True)
class Pairing:
    """Outcomes of two policies on the same episodes.

    Attributes:
        both: Episodes that both solved.
        only_first: Episodes that only the first solved.
        only_second: Episodes that only the second solved.
        neither: Episodes that none solved.
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


def compare(config: CompareConfig) -> None:
    """Compare two benchmark results episode by episode.

    Pairs the episodes by seed and prints both success rates with their 95 % Wilson intervals, how many episodes
    only one policy solved, and the p-value of McNemar's exact test. Overlapping intervals do not mean that two
    policies are equal: on the same episodes the paired test sees smaller differences.

    Examples:
        lerobot-bimanual compare --first=results/peract2.json --second=results/act.json
    """
    first, second = ResultRow.read(config.first), ResultRow.read(config.second)
    pairing = pair(first, second)
    table = Table(title=f"{first.task}, variation {first.variation}: same {first.split} seeds")
    for heading in ("result", "policy", "solved", "95 % interval (Wilson)"):
        table.add_column(heading, justify="left" if heading in ("result", "policy") else "right")
    shared = _seeds(first) & _seeds(second)
    for path, row in ((config.first, first), (config.second, second)):
        rate = success_rate(tuple(episode for episode in row.episodes if episode.seed in shared))
        low, high = rate.interval
        policy = f"{row.policy} ({row.recipe})"
        table.add_row(path.stem, policy, f"{rate.successes} of {rate.trials}", f"{low:.0%} to {high:.0%}")
    console = Console()
    console.print(table)
    console.print(
        f"both {pairing.both}, only the first {pairing.only_first}, only the second {pairing.only_second}, "
        f"neither {pairing.neither}; McNemar's exact test: p = {pairing.p_value:.3g}",
        soft_wrap=True,
        highlight=False,
    )


def pair(first: ResultRow, second: ResultRow) -> Pairing:
    """Count the outcomes of two rows on the seeds that they share.

    Raises:
        BimanualError: The rows differ in task, variation, split or simulation, or share no seed.
    """
    for name in ("task", "variation", "split"):
        one, other = getattr(first, name), getattr(second, name)
        if one != other:
            raise BimanualError(
                f"the results differ in {name}: {one!r} and {other!r}; compare like with like"
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


def _seeds(row: ResultRow) -> set[int]:
    return {episode.seed for episode in row.episodes}
