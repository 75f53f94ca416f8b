"""The verb `leaderboard`."""

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.benchmark.leaderboard import render


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
    page = render(config.results)
    if config.output is None:
        print(page)
    else:
        config.output.parent.mkdir(parents=True, exist_ok=True)
        config.output.write_text(page, encoding="utf-8")
