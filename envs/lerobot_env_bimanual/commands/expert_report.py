"""The command `expert report`."""

from dataclasses import dataclass
from pathlib import Path

from lerobot_bimanual.files import check_output_file
from lerobot_bimanual.pages import write_page
from lerobot_bimanual.terminal import show_next


@dataclass
class ExpertReportConfig:
    """Flags of `expert report`."""

    # Folder whose folders `standard` and `varied` hold the files that `expert evaluate` has written, and `perturbed` those of
    # --axes.
    expert_reports: Path = Path("results/expert_reports")
    # Markdown file; without it the page is printed. Beside it goes expert_robustness.md, if there is a folder `perturbed`.
    output: Path | None = None


def expert_report(config: ExpertReportConfig) -> None:
    """Write the measured tables of all tasks, beside the paper's, from expert reports.

    Every report must be of the world, split and first seed of that of the experts in its setting. Nothing is written if one
    is wrong. A second page says in which perturbed conditions the experts still succeed.

    Examples:
        lerobot-bimanual expert report
        lerobot-bimanual expert report --output=docs/tasks.md
    """
    from lerobot_bimanual.reports.robustness import expert_robustness_page
    from lerobot_bimanual.results.robustness import read_expert_robustness
    from lerobot_env_bimanual.reports.expert_tables import tasks_page

    if config.output is not None:
        check_output_file(config.output)
    perturbed = config.expert_reports / "perturbed"
    pages = {config.output: tasks_page(config.expert_reports)}
    if perturbed.is_dir() and config.output is not None:
        page = expert_robustness_page(read_expert_robustness(perturbed))
        pages[config.output.with_name("expert_robustness.md")] = page
    for path, page in pages.items():
        write_page(page, path)
        if path is not None:
            print(f"page {path}")
    show_next("lerobot-bimanual", "policy", "benchmark")
