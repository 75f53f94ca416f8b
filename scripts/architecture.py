"""Write the rooms of docs/floors.toml into docs/architecture.md, between its two marks.

Usage: architecture.py
"""

import tomllib
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
BEGIN, END = "<!-- floors: written by scripts/architecture.py -->\n", "<!-- end of floors -->\n"


def main() -> None:
    """Rewrite the page."""
    path = DOCS / "architecture.md"
    path.write_text(with_floors(path.read_text(encoding="utf-8")), encoding="utf-8")


def with_floors(page: str) -> str:
    """The page with its tables of rooms as the declaration has them."""
    before, rest = page.split(BEGIN)
    _, after = rest.split(END)
    floors = tomllib.loads((DOCS / "floors.toml").read_text(encoding="utf-8"))
    tables = [_table(distribution, rooms) for distribution, rooms in floors.items()]
    return before + BEGIN + "\n" + "\n".join(tables) + END + after


def _table(distribution: str, rooms: dict[str, str]) -> str:
    """One distribution's rooms, the topmost first."""
    lines = [f"| `{name}` | {meaning} |" for name, meaning in reversed(rooms.items())]
    return "\n".join([f"| `{distribution}` | |", "|---|---|", *lines]) + "\n"


if __name__ == "__main__":
    main()
