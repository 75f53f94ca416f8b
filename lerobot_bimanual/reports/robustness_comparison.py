"""Two policies on the same ladder, rung by rung."""

from collections.abc import Iterator
from dataclasses import dataclass

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.ladder.result import LEVEL_0, LadderResult, Rung
from lerobot_bimanual.reports.drops import corrected_by_level
from lerobot_bimanual.results.comparison import Pairing
from lerobot_bimanual.tables import print_table
from lerobot_bimanual.versions import SIMULATION_PACKAGES

HEADINGS = ("rung", "first", "second", "only one solved", "p", "p (Holm)")


@dataclass(frozen=True)
class LadderComparison:
    """Two ladders of one task.

    Attributes:
        first: of the first policy.
        second: of the second.

    Raises:
        BimanualError: they differ in task, options, seeds, worlds or simulation.
    """

    first: LadderResult
    second: LadderResult

    def __post_init__(self) -> None:
        for name, one, other in self._pairs():
            if one != other:
                raise BimanualError(
                    f"the ladders differ in {name}: {one!r} and {other!r}; compare like with like"
                )

    def _pairs(self) -> Iterator[tuple[str, object, object]]:
        """What must be the same in both."""
        yield "task", self.first.task, self.second.task
        for name in ("split", "variation", "max_keyposes"):
            yield name, self.first.options.get(name), self.second.options.get(name)
        yield "seeds", self.first.level_0.seeds, self.second.level_0.seeds
        for name, one, other in self.rungs:
            yield f"the world of {name}", one.world, other.world
        for package in SIMULATION_PACKAGES:
            yield package, self.first.versions.get(package), self.second.versions.get(package)

    @property
    def rungs(self) -> list[tuple[str, Rung, Rung]]:
        """Name of each rung that both have, and both."""
        theirs = self.second.by_name
        return [(rung.name, rung, theirs[rung.name]) for rung in self.first.rungs if rung.name in theirs]

    @property
    def missing(self) -> list[str]:
        """Rungs that only one of both has."""
        return sorted(self.first.by_name.keys() ^ self.second.by_name.keys())

    def print(self) -> None:
        """Print a line per rung: successes, and McNemar's exact test on the same episodes.

        Its p-values are corrected by Holm for how many axes have a certified rung of the same level.
        """
        episodes = len(self.first.level_0.episodes)
        title = f"success on {self.first.task}, the same {episodes} episodes at every rung"
        pairings = {name: Pairing.of(one.solved, other.solved) for name, one, other in self.rungs}
        certified = (one for _, one, other in self.rungs if one.is_certified and other.is_certified)
        corrected = corrected_by_level(certified, pairings)
        rows = [
            (
                name,
                one.rates["policy"].successes,
                other.rates["policy"].successes,
                f"{pairings[name].only_first}, {pairings[name].only_second}",
                f"{pairings[name].p_value:.3g}",
                f"{corrected[name]:.3g}" if name in corrected else "not certified",
            )
            for name, one, other in self.rungs
        ]
        print_table(HEADINGS, rows, title)

    def remarks(self) -> Iterator[str]:
        """What is to be said below the table."""
        for level in sorted({rung.level for _, rung, _ in self.rungs}):
            pairs = [
                (one, other)
                for _, one, other in self.rungs
                if one.level == level and one.is_certified and other.is_certified
            ]
            solved = [sum(sum(rung.solved) for rung in rungs) for rungs in zip(*pairs, strict=True)]
            if solved:
                trials = sum(len(one.episodes) for one, _ in pairs)
                where = LEVEL_0 if not level else f"certified rungs of level {level}"
                yield f"{where}: first {solved[0]}, second {solved[1]} of {trials}"
        if self.missing:
            yield f"only one has played: {', '.join(self.missing)}"
