"""Write the tables of hand-written pages that come from elsewhere, each between its two marks.

Usage: tables.py
"""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

import pandas as pd

from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.ladder.result import LEVEL_0, LadderResult, rung_name
from lerobot_bimanual.pages import markdown_table
from lerobot_bimanual.perturbation_levels import MAX_LEVEL
from lerobot_bimanual.reports.benchmark_page import mean_cell, read_rows, success_cell, success_table
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes

ROOT = Path(__file__).parents[1]
BOARD, WITHOUT_SQUARES = ROOT / "results/leaderboard", ROOT / "results/without_squares"
SQUARES = "policy.grid_squares"
"""Flag of the board's PerActs; the other policies there have no grid."""
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


def _table(heads: Sequence[str], lines: Sequence[Sequence[object]], words: bool = False) -> str:
    return markdown_table(
        pd.DataFrame([[str(cell) for cell in line] for line in lines], columns=[*heads]), words
    )


def _results() -> str:
    return markdown_table(success_table(list(read_rows(BOARD).values())))


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
    return _table(("axis", "group", "what is different", "levels 1, 2, 3"), rows, words=True)


def _mended() -> str:
    """Ladders of policies that learned in perturbed worlds, each below that of its like which did not."""
    plain = _plain()
    played = {
        each.checkpoint_sha256: each
        for each in map(LadderResult.read, (ROOT / "results/ladders").rglob("*.json"))
    }
    lines = []
    for row in read_rows(ROOT / "results/perturbed_demonstrations").values():
        for axis in played[row.checkpoint_sha256].axes:
            rungs = [LEVEL_0, *(rung_name(axis.name, level) for level in range(1, MAX_LEVEL + 1))]
            for each in (plain[_training(row)], row):
                found = played[each.checkpoint_sha256].by_name
                solved = [found[rung].rates["policy"].successes for rung in rungs]
                lines.append(
                    (
                        f"`{axis.name}`",
                        f"`{row.policy}` on `{row.task}`",
                        f"`{each.demos_perturb}`" if each.demos_perturb else "as they are",
                        *solved,
                        each.rates["policy"],
                    )
                )
    heads = ("axis", "policy", "demonstrations", "level 0", "1", "2", "3", "of level 0, on the board's seeds")
    return _table(heads, lines)


def _few() -> str:
    """Policies that learned from few demonstrations, beside those that learned from all."""
    return _task_by_task("few_demonstrations", "20 demonstrations", "100 demonstrations")


def _uncounted() -> str:
    """Policies that are not told how many keyposes were executed, beside those that are."""
    return _task_by_task("without_keypose_step", "not told the count", "told the count")


def _squares() -> str:
    return _beside_those_without_squares("peract2")


def _squares_of_others() -> str:
    return _beside_those_without_squares("peract_lf", "peract_independent")


def _beside_those_without_squares(*policies: str) -> str:
    """Policies of the board, which are shown squares, beside trainings that differ in nothing else."""
    plain = _plain()
    shown, not_shown = defaultdict(list), defaultdict(list)
    for row in read_rows(WITHOUT_SQUARES).values():
        shown[row.policy, row.task].append(plain[*_training(row)[:-1], "true"])
        not_shown[row.policy, row.task].append(row)
    tasks = dict.fromkeys(task for _, task in shown)
    columns = {
        f"`{policy}` {head}": [side[policy, task] for task in tasks]
        for policy in policies
        for head, side in (("with squares", shown), ("without", not_shown))
    }
    lines = zip(
        (f"`{task}`" for task in tasks), *(map(success_cell, each) for each in columns.values()), strict=True
    )
    means = map(mean_cell, columns.values())
    return _table(("task", *columns), [*lines, (f"mean of {len(tasks)}", *means)])


def _fresh() -> str:
    """The first PerAct2s of the board on its seeds and on others."""
    return _task_by_task("fresh_seeds", "fresh seeds", "seeds of the board")


def _task_by_task(room: str, own_head: str, usual_head: str) -> str:
    pairs = _beside_plain(room)
    rates = [(row.rates["policy"], usual.rates["policy"], row.rates["blind"]) for row, usual in pairs]
    lines = [(f"`{row.task}`", *beside) for (row, _), beside in zip(pairs, rates, strict=True)]
    means = [f"{fmean(rate.rate for rate in column):.1%}" for column in zip(*rates, strict=True)]
    return _table(("task", own_head, usual_head, "blind"), [*lines, (f"mean of {len(lines)}", *means)])


def _again() -> str:
    """Cells that were made again, beside the first ones."""
    lines = [
        (
            f"`{row.policy}` on `{row.task}`",
            *(each for one in (row, usual) for each in (one.rates["policy"], one.checkpoint_sha256[:12])),
        )
        for row, usual in _beside_plain("made_again")
    ]
    return _table(("cell", "made again", "weights", "made first", "weights"), lines)


def _beside_plain(room: str) -> list[tuple[ResultRow, ResultRow]]:
    """Each row of a trial, and the plain row of the same training but for what was tried."""
    plain = _plain()
    return [(row, plain[_training(row)]) for row in read_rows(ROOT / "results" / room).values()]


def _plain() -> dict[tuple[str, ...], ResultRow]:
    """The rows of the board and those without squares, each by what names its training."""
    rows = [*read_rows(BOARD).values(), *read_rows(WITHOUT_SQUARES).values()]
    return {_training(row): row for row in rows if row.learner == row.policy}


def _training(row: ResultRow) -> tuple[str, ...]:
    return row.task, row.policy, row.flags["seed"], row.flags.get(SQUARES, "false")


TABLES = {
    "results": ("README.md", _results),
    "axes": ("docs/robustness.md", _axes),
    "mended": ("docs/robustness.md", _mended),
    "few": ("docs/learning.md", _few),
    "uncounted": ("docs/learning.md", _uncounted),
    "squares": ("docs/learning.md", _squares),
    "squares of others": ("docs/learning.md", _squares_of_others),
    "fresh": ("docs/learning.md", _fresh),
    "again": ("docs/benchmark.md", _again),
}
"""By name: the page that holds the table, and who writes it."""

if __name__ == "__main__":
    main()
