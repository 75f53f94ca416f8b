"""The verb `report`: what the certificates say, as a page of documentation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass
class ExpertReportConfig:
    """Options of the verb `report`."""

    certificates: Path = Path("results/certificates")  # folder of the files that `certify` has written
    # Pixel counts, written by `scripts/visibility.py`; left out if the file does not exist.
    visibility: Path = Path("results/visibility.json")
    output: Path | None = None  # Markdown file; without it the page is printed


def expert_report(config: ExpertReportConfig) -> None:
    """Write the measured table of all tasks, beside the paper's, from certificates.

    Every certificate is checked first, by itself and against that of the experts: who played which episodes, in which
    world and with which versions, and all that follows from the episodes. Nothing is written if one is wrong.

    Examples:
        lerobot-bimanual expert report
        lerobot-bimanual expert report --output=docs/tasks.md
    """
    from lerobot_bimanual.errors import BimanualError
    from lerobot_bimanual.markdown_table import write_page
    from lerobot_bimanual.output_file import check_output_file
    from lerobot_env_bimanual.reports.certified import EXACT, Certified
    from lerobot_env_bimanual.reports.tasks_page import tasks_page
    from lerobot_env_bimanual.reports.visibility import Visibility

    if config.output is not None:
        check_output_file(config.output)
    certified = Certified.read(config.certificates)
    seen = Visibility.read(config.visibility) if config.visibility.exists() else None
    if seen and seen.worlds != certified.certificates[EXACT].worlds:
        raise BimanualError(
            f"{config.visibility} was measured in other worlds than the certificates; "
            "run scripts/visibility.py again"
        )
    write_page(tasks_page(certified, config.certificates, seen), config.output)
