"""Write the results of results/leaderboard into README.md, between its two marks.

Usage: readme.py
"""

from pathlib import Path

from lerobot_bimanual.benchmark.leaderboard import read_rows, success_table

ROOT = Path(__file__).parents[1]
BEGIN, END = "<!-- results: written by scripts/readme.py -->\n", "<!-- end of results -->\n"


def main() -> None:
    """Rewrite the page."""
    path = ROOT / "README.md"
    path.write_text(with_results(path.read_text(encoding="utf-8")), encoding="utf-8")


def with_results(page: str) -> str:
    """The page with its table of results as the board has it."""
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    rows = list(read_rows(ROOT / "results/leaderboard").values())
    return f"{before}{BEGIN}\n{success_table(rows)}\n\n{END}{after}"


if __name__ == "__main__":
    main()
