"""The command `results report`."""

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.files import check_output_file
from lerobot_bimanual.pages import write_page
from lerobot_bimanual.terminal import show_next


@dataclass
class ResultsReportConfig:
    """Flags of `results report`."""

    # A file, or a folder of files, that `policy benchmark` has written.
    results: Path = field(kw_only=True)
    # The page, Markdown; without it the page is printed.
    output: Path | None = None


def results_report(config: ResultsReportConfig) -> None:
    """Write a page of results: success of all policies on all tasks side by side.

    Every file is checked first, by itself and against the others; nothing is written if one is wrong.

    Examples:
        lerobot-bimanual results report --results=results/leaderboard
        lerobot-bimanual results report --results=results/leaderboard --output=docs/results.md
    """
    from lerobot_bimanual.reports.benchmark_page import benchmark_page, read_results

    if config.output is not None:
        check_output_file(config.output)
    write_page(benchmark_page(read_results(config.results), config.results), config.output)
    if config.output is not None:
        print(config.output)
        show_next("lerobot-bimanual", "results", "verify", f"--results={config.results}")
