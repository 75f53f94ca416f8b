"""The command `expert report`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROBUSTNESS_PAGE = "expert_robustness.md"


@dataclass
class ExpertReportConfig:
    """Flags of `expert report`."""

    # Folder of the files that `expert evaluate` has written.
    certificates: Path = Path("results/certificates")
    # Markdown file; without it the page is printed. Beside it goes expert_robustness.md, if CERTIFICATES has a folder `rungs`.
    output: Path | None = None


def expert_report(config: ExpertReportConfig) -> None:
    """Write the measured tables of all tasks, beside the paper's, from expert reports.

    Every file is checked first, by itself and against that of the experts: who played which episodes, in which world and
    with which versions. Nothing is written if one is wrong. A second page says which perturbed conditions the experts
    still solve.

    Examples:
        lerobot-bimanual expert report
        lerobot-bimanual expert report --output=docs/tasks.md
    """
    from lerobot_bimanual.ladder.rung_certificate import read_rung_certificates
    from lerobot_bimanual.output_file import check_output_file
    from lerobot_bimanual.pages import write_page
    from lerobot_bimanual.reports.expert_robustness_page import expert_robustness_page
    from lerobot_env_bimanual.reports.certified import Certified
    from lerobot_env_bimanual.reports.tasks_page import tasks_page

    if config.output is not None:
        check_output_file(config.output)
    perturbed = config.certificates / "rungs"
    pages = {config.output: tasks_page(Certified.read(config.certificates), config.certificates)}
    if perturbed.is_dir() and config.output is not None:
        page = expert_robustness_page(read_rung_certificates(perturbed))
        pages[config.output.with_name(ROBUSTNESS_PAGE)] = page
    for path, page in pages.items():
        write_page(page, path)
        if path is not None:
            print(f"page {path}")
