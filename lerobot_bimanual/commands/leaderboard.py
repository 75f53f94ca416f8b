"""The verb `leaderboard`."""

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.benchmark.leaderboard import render
from lerobot_bimanual.markdown_table import write_page
from lerobot_bimanual.output_file import check_output_file


@dataclass
class LeaderboardConfig:
    """Flags of the `leaderboard` verb."""

    results: Path = field(kw_only=True)  # folder of the files that `benchmark` has written, of one recipe
    # Folder of certificates, of whose worlds the results must be; by default `certificates` beside RESULTS, if it exists.
    certificates: Path | None = None
    output: Path | None = None  # Markdown file; without it the page is printed


def leaderboard(config: LeaderboardConfig) -> None:
    """Write the success of all policies on all tasks side by side, from the results of `benchmark`.

    Every file is checked first, by itself and against the others: who played which episodes of which split, in which
    world and with which versions, and whether the tested checkpoint was the best. Nothing is written if one is wrong.

    Examples:
        lerobot-bimanual leaderboard --results=results/small
        lerobot-bimanual leaderboard --results=results/small --output=docs/results.md
    """
    if config.output is not None:
        check_output_file(config.output)
    write_page(render(config.results, config.certificates), config.output)
