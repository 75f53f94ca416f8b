"""The verb `leaderboard`."""

from dataclasses import dataclass, field
from pathlib import Path

from lerobot_bimanual.benchmark.leaderboard import read_rows, render
from lerobot_bimanual.benchmark.success_figure import success_figure
from lerobot_bimanual.canvas import check_figure_file
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.markdown_table import write_page
from lerobot_bimanual.output_file import check_output_file, check_output_folder


@dataclass
class ResultsLeaderboardConfig:
    """Flags of the `leaderboard` verb."""

    results: Path = field(kw_only=True)  # folder of the files that `benchmark` has written, of one recipe
    # Folder of certificates, of whose worlds the results must be; by default `certificates` beside RESULTS, if it exists.
    certificates: Path | None = None
    output: Path | None = None  # Markdown file; without it the page is printed
    figure: Path | None = None  # PNG: success with its intervals, shown in the page
    # Folder for the same rows in the Hub's form, one file for `.eval_results/` of each model's repository.
    hub_results: Path | None = None
    benchmark_repo: str | None = None  # dataset repository of the benchmark there, ORGANISATION/NAME


def results_leaderboard(config: ResultsLeaderboardConfig) -> None:
    r"""Write the success of all policies on all tasks side by side, from the results of `benchmark`.

    Every file is checked first, by itself and against the others: who played which episodes of which split, in which
    world and with which versions, and whether the tested checkpoint was the best. Nothing is written if one is wrong.

    Examples:
        lerobot-bimanual results leaderboard --results=results/leaderboard
        lerobot-bimanual results leaderboard --results=results/leaderboard --output=docs/results.md --figure=docs/results.png
        lerobot-bimanual results leaderboard --results=results/leaderboard --hub_results=outputs/eval_results \
            --benchmark_repo=me/bimanual
    """
    if config.output is not None:
        check_output_file(config.output)
    if config.figure is not None:
        check_figure_file(config.figure)
    if config.hub_results is not None:
        if config.benchmark_repo is None or config.benchmark_repo.count("/") != 1:
            raise BimanualError(
                f"benchmark_repo is {config.benchmark_repo!r}, but --hub_results needs the dataset repository that stands for "
                "the benchmark on the Hub, ORGANISATION/NAME"
            )
        check_output_folder(config.hub_results)
    write_page(render(config.results, config.certificates, _link(config)), config.output)
    if config.figure is not None:
        success_figure([*read_rows(config.results).values()]).save(config.figure)
    if config.hub_results is not None and config.benchmark_repo is not None:
        from lerobot_bimanual.benchmark.hub_results import write_hub_results

        for path in write_hub_results(config.results, config.hub_results, config.benchmark_repo):
            print(path)


def _link(config: ResultsLeaderboardConfig) -> str | None:
    """Where the figure lies, seen from the page."""
    if config.figure is None or config.output is None:
        return None if config.figure is None else config.figure.as_posix()
    return config.figure.resolve().relative_to(config.output.resolve().parent, walk_up=True).as_posix()
