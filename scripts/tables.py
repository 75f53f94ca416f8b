"""Write the tables of hand-written pages that come from elsewhere, each between its two marks.

Usage: tables.py
"""

from pathlib import Path

from lerobot_bimanual.benchmark.leaderboard import read_rows, success_table
from lerobot_bimanual.markdown_table import markdown_table
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes

ROOT = Path(__file__).parents[1]
BEGIN, END = "<!-- {}: written by scripts/tables.py -->\n", "<!-- end of {} -->\n"


def main() -> None:
    """Rewrite the pages."""
    for name, (page, _) in TABLES.items():
        path = ROOT / page
        path.write_text(with_table(path.read_text(encoding="utf-8"), name), encoding="utf-8")


def with_table(page: str, name: str) -> str:
    """The page with one of its tables as it has to be."""
    begin, end = BEGIN.format(name), END.format(name)
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{TABLES[name][1]()}\n\n{end}{after}"


def _results() -> str:
    return str(success_table(list(read_rows(ROOT / "results/leaderboard").values())))


def _axes() -> str:
    axes = sorted((get_axis(name) for name in list_axes()), key=lambda axis: axis.group)
    rows = [
        (
            f"`{axis.name}`",
            axis.group,
            axis.summary,
            f"{', '.join(f'{level:g}' for level in axis.levels)} {axis.unit}",
        )
        for axis in axes
    ]
    return markdown_table(("axis", "group", "what is different", "levels 1, 2, 3"), rows, of_words=True)


TABLES = {"results": ("README.md", _results), "axes": ("docs/robustness.md", _axes)}
"""By name: the page that holds the table, and who writes it."""

if __name__ == "__main__":
    main()
