"""The command `results report`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal
from urllib.parse import quote

from lerobot_bimanual.errors import check_range
from lerobot_bimanual.files import check_output_file, write_file
from lerobot_bimanual.pages import write_page
from lerobot_bimanual.terminal import show_next
from lerobot_env_bimanual.workers import WorkerPool


@dataclass
class ResultsReportConfig:
    """Flags of `results report`."""

    # A file, or a folder of files, that `policy benchmark` or `policy robustness` has written; for HTML also records that
    # `lerobot-eval --env.results_dir` has left.
    results: Path = field(kw_only=True)
    # md: a page of tables with a figure beside it; html: one file with figures and videos of failed episodes
    format: Literal["md", "html"] = "md"
    # The page; by default Markdown is printed, and HTML goes to outputs/results.html.
    output: Path | None = None
    max_videos: int = 3  # videos in HTML: failed episodes of each result, of different kinds first
    workers: int = 0  # processes for HTML; 0 takes one per core


def results_report(config: ResultsReportConfig) -> None:
    """Write a page of results: success of policies side by side, their robustness, or how they failed.

    As Markdown, results of `policy benchmark` become the table of success of all policies on all tasks, and results of
    `policy robustness` the tables of what each condition costs each policy. The figure is written beside the page.

    As HTML, results of `policy benchmark` and of `lerobot-eval` become one file that loads nothing from elsewhere, with
    every episode, why failed ones failed, which arm lost them, and videos of them beside the expert's. Videos are replays
    from the recorded actions, compared state by state; no weights are needed.

    Every file is checked first, by itself and against the others; nothing is written if one is wrong.

    Examples:
        lerobot-bimanual results report --results=results/leaderboard
        lerobot-bimanual results report --results=results/leaderboard --output=docs/results.md
        lerobot-bimanual results report --results=results/robustness --output=docs/robustness_results.md
        lerobot-bimanual results report --results=results/leaderboard --format=html --output=outputs/results.html
    """
    check_range("max_videos", config.max_videos, 0)
    if config.output is not None:
        check_output_file(config.output)
    write = _write_html if config.format == "html" else _write_markdown
    write(config)
    if config.output is not None or config.format == "html":
        show_next("lerobot-bimanual", "results", "verify", f"--results={config.results}")


def _write_markdown(config: ResultsReportConfig) -> None:
    from lerobot_bimanual.reports.benchmark_page import benchmark_page, read_results
    from lerobot_bimanual.reports.robustness_figure import heat_map
    from lerobot_bimanual.reports.robustness_pages import robustness_page
    from lerobot_bimanual.reports.success_figure import success_figure
    from lerobot_bimanual.results.record import result_paths
    from lerobot_bimanual.results.robustness import RobustnessResult, is_robustness_result

    paths, figure = result_paths(config.results), config.output and config.output.with_suffix(".png")
    link = figure and quote(figure.name)
    if is_robustness_result(paths[0]):
        results = {path.stem: RobustnessResult.read(path) for path in paths}
        page, chart = robustness_page(results, link), heat_map(results)
    else:
        rows = read_results(config.results)
        page, chart = benchmark_page(rows, config.results, link), success_figure([*rows.values()])
    write_page(page, config.output)
    if figure is not None:
        chart.save(figure)
        print(f"page   {config.output}\nfigure {figure}")


def _write_html(config: ResultsReportConfig) -> None:
    from lerobot_bimanual.results.comparison import check_comparable
    from lerobot_bimanual.results.record import result_paths
    from lerobot_env_bimanual.reports.results_page import results_page, sections_of
    from lerobot_env_bimanual.verification.result_files import ResultFile

    results = [ResultFile.read(path) for path in result_paths(config.results)]
    for result in results:
        result.check_world()
    check_comparable({result.path: result.benchmark for result in results if result.benchmark is not None})
    with WorkerPool(config.workers) as pool:
        sections = sections_of(results, config.max_videos, pool)
    page, output = results_page(sections), config.output or Path("outputs/results.html")
    write_file(output, page)
    videos = sum(len(section.videos) for section in sections)
    print(f"{output}: {len(results)} results, {videos} videos, {len(page.encode()) / 1e6:.1f} MB")
