"""The verb `leaderboard`."""

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.benchmark.leaderboard import render
from lerobot_bimanual.markdown_table import write_page


@dataclass
class LeaderboardConfig:
    """Flags of the `leaderboard` verb."""

    results: Path = field(kw_only=True)  # folder of the files that `benchmark` has written, of one recipe
    output: Path | None = None  # Markdown file; without it the page is printed


def leaderboard(config: LeaderboardConfig) -> None:
    """Write the success of all policies on all tasks side by side, from the results of `benchmark`.

    Examples:
        lerobot-bimanual leaderboard --results=results/small
        lerobot-bimanual leaderboard --results=results/small --output=docs/results.md
    """
    write_page(render(config.results), config.output)
