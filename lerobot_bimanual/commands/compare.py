"""The verb `compare`."""

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

from lerobot_bimanual.benchmark.pairing import pair
from lerobot_bimanual.benchmark.results import ResultRow, success_rate


@dataclass
class CompareConfig:
    """Flags of the `compare` verb."""

    first: Path = field(kw_only=True)  # result of one benchmark, a JSON file
    second: Path = field(kw_only=True)  # result of another one on the same task, variation and split


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
        justify = "left" if heading in ("result", "policy") else "right"
        table.add_column(heading, justify=justify, overflow="fold")
    shared = _seeds(first) & _seeds(second)
    console = Console()
    for name, path, row in (("first", config.first, first), ("second", config.second, second)):
        rate = success_rate(tuple(episode for episode in row.episodes if episode.seed in shared))
        low, high = rate.interval
        policy = f"{row.policy} ({row.recipe})"
        console.print(
            f"{name:<7} {path}", soft_wrap=True, highlight=False, markup=False
        )  # too long for a column
        table.add_row(name, policy, f"{rate.successes} of {rate.trials}", f"{low:.0%} to {high:.0%}")
    console.print(table)
    console.print(
        f"both {pairing.both}, only the first {pairing.only_first}, only the second {pairing.only_second}, "
        f"neither {pairing.neither}; McNemar's exact test: p = {pairing.p_value:.3g}",
        soft_wrap=True,
        highlight=False,
    )


def _seeds(row: ResultRow) -> set[int]:
    return {episode.seed for episode in row.episodes}
