"""Two policies on the same result, condition by condition."""

from collections.abc import Iterator
from dataclasses import dataclass

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.reports.drops import corrected_by_level
from lerobot_bimanual.results.robustness import NOMINAL, PolicyCondition, RobustnessResult
from lerobot_bimanual.results.statistics import Pairing
from lerobot_bimanual.tables import print_table
from lerobot_bimanual.versions import SIMULATION_PACKAGES

HEADINGS = ("condition", "first", "second", "only one solved", "p", "p (Holm)")


@dataclass(frozen=True)
class RobustnessComparison:
    """Two results of one task.

    Attributes:
        first: of the first policy.
        second: of the second.

    Raises:
        BimanualError: they differ in task, options, seeds, worlds or simulation.
    """

    first: RobustnessResult
    second: RobustnessResult

    def __post_init__(self) -> None:
        for name, one, other in self._pairs():
            if one != other:
                raise BimanualError(
                    f"the results differ in {name}: {one!r} and {other!r}; compare like with like"
                )

    def _pairs(self) -> Iterator[tuple[str, object, object]]:
        """What must be the same in both."""
        yield "task", self.first.task, self.second.task
        for name in ("split", "variation", "max_keyposes"):
            yield name, self.first.config.options.get(name), self.second.config.options.get(name)
        yield "seeds", self.first.nominal.seeds, self.second.nominal.seeds
        for name, one, other in self.conditions:
            yield f"the world of {name}", one.world, other.world
        for package in SIMULATION_PACKAGES:
            yield package, self.first.config.versions.get(package), self.second.config.versions.get(package)

    @property
    def conditions(self) -> list[tuple[str, PolicyCondition, PolicyCondition]]:
        """Name of each condition that both have, and both."""
        theirs = self.second.by_name
        return [
            (condition.name, condition, theirs[condition.name])
            for condition in self.first.conditions
            if condition.name in theirs
        ]

    @property
    def missing(self) -> list[str]:
        """Rungs that only one of both has."""
        return sorted(self.first.by_name.keys() ^ self.second.by_name.keys())

    def print(self) -> None:
        """Print a line per condition: successes, and McNemar's exact test on the same episodes.

        Its p-values are corrected by Holm for how many axes have a valid condition of the same level.
        """
        episodes = len(self.first.nominal.episodes)
        title = f"success on {self.first.task}, the same {episodes} episodes at every condition"
        pairings = {name: Pairing.of(one.solved, other.solved) for name, one, other in self.conditions}
        certified = (one for _, one, other in self.conditions if one.is_valid and other.is_valid)
        corrected = corrected_by_level(certified, pairings)
        rows = [
            (
                name,
                one.rates["policy"].successes,
                other.rates["policy"].successes,
                f"{pairings[name].only_first}, {pairings[name].only_second}",
                f"{pairings[name].p_value:.3g}",
                f"{corrected[name]:.3g}" if name in corrected else "not valid",
            )
            for name, one, other in self.conditions
        ]
        print_table(HEADINGS, rows, title)

    def remarks(self) -> Iterator[str]:
        """What is to be said below the table."""
        for level in sorted({condition.level for _, condition, _ in self.conditions}):
            pairs = [
                (one, other)
                for _, one, other in self.conditions
                if one.level == level and one.is_valid and other.is_valid
            ]
            solved = [
                sum(sum(condition.solved) for condition in conditions)
                for conditions in zip(*pairs, strict=True)
            ]
            if solved:
                trials = sum(len(one.episodes) for one, _ in pairs)
                where = NOMINAL if not level else f"valid conditions of level {level}"
                yield f"{where}: first {solved[0]}, second {solved[1]} of {trials}"
        if self.missing:
            yield f"only one has played: {', '.join(self.missing)}"
