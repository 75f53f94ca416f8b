"""The verb `robustness`."""

from dataclasses import dataclass
from pathlib import Path

from lerobot_bimanual.canvas import check_figure_file
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.ladder import certificates_page, ladders_page
from lerobot_bimanual.ladder.heat_map import heat_map
from lerobot_bimanual.ladder.result import LadderResult
from lerobot_bimanual.ladder.rung_certificate import read_rung_certificates
from lerobot_bimanual.markdown_table import write_page
from lerobot_bimanual.output_file import check_output_file


@dataclass
class ResultsRobustnessConfig:
    """Flags of the `robustness` verb."""

    ladders: tuple[Path, ...] = ()  # results of `ladder`: files, or folders of them
    certificates: Path | None = None  # folder of what `certify-rungs` has written
    output: Path | None = None  # Markdown file; without it the page is printed
    figure: Path | None = None  # PNG: a heat map, axis against ladder


def results_robustness(config: ResultsRobustnessConfig) -> None:
    """Write what several policies survive, and where the experts still succeed, side by side.

    Every file is checked first; nothing is written if one is wrong.

    Examples:
        lerobot-bimanual results robustness --ladders=outputs/ladder --figure=outputs/robustness.png
        lerobot-bimanual results robustness --certificates=results/certificates/rungs --output=outputs/rungs.md
    """
    if config.output is not None:
        check_output_file(config.output)
    if config.figure is not None:
        check_figure_file(config.figure)
    paths = [
        path
        for place in config.ladders
        for path in (sorted(place.glob("*.json")) if place.is_dir() else [place])
    ]
    ladders = {path.stem: LadderResult.read(path) for path in paths}
    if len(ladders) < len(paths):
        raise BimanualError(
            "two ladders have files of the same name; rename one, so that they can be told apart"
        )
    if not ladders and (config.certificates is None or config.figure is not None):
        raise BimanualError(
            "there are no results of `lerobot-bimanual policy robustness` at --ladders, and no --certificates to write instead"
        )
    parts = (
        [ladders_page.HEADING, ladders_page.LEGEND, ladders_page.render(ladders)]
        if ladders
        else [certificates_page.HEADING]
    )
    if config.certificates is not None:
        parts.append(certificates_page.render(read_rung_certificates(config.certificates)))
    write_page("\n".join(parts), config.output)
    if config.figure is not None:
        heat_map(ladders).save(config.figure)
