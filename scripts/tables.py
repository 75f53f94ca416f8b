"""Write the tables of results, tasks and perturbations into README.md and pages of the docs.

Each table is between two comments of its page. Usage: tables.py
"""

import json
from operator import attrgetter
from pathlib import Path
from typing import Any

import pandas as pd

from lerobot_bimanual.pages import markdown_table
from lerobot_bimanual.reports.benchmark_page import ABSENT, board_table, read_results, results_table
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.comparison import Comparison, check_comparable
from lerobot_env_bimanual.registry import AXES
from lerobot_env_bimanual.reports.expert_tables import PAPER
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

ROOT = Path(__file__).parents[1]
LEADERBOARD, ABLATION = ROOT / "results/leaderboard", ROOT / "results/ablation"
POLICIES = {
    "act": "ACT",
    "rvt_lf": "RVT-LF",
    "peract_independent": "independent",
    "peract_lf": "PerAct-LF",
    "peract2": "PerAct2",
}
"""Policies of the paper's table, and their names in it."""
NO_RESULTS = "No policy has been scored in the present world yet."
BEGIN, END = "<!-- {}: written by scripts/tables.py -->\n", "<!-- end of {} -->\n"


def main() -> None:
    """Rewrite the pages."""
    for name, (page, _) in TABLES.items():
        path = ROOT / page
        path.write_text(with_table(path.read_text(encoding="utf-8"), name), encoding="utf-8")


def with_table(page: str, name: str) -> str:
    """A page with one of its tables written anew."""
    begin, end = BEGIN.format(name), END.format(name)
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{TABLES[name][1]()}\n\n{end}{after}"


def _results() -> str:
    """Means over tasks in percent, a line per policy and a column per protocol; lines without any are left out.

    Intervals are those of policies alone.
    """
    if not LEADERBOARD.is_dir():
        return NO_RESULTS
    check_comparable(results := read_results(LEADERBOARD))
    board = board_table(results_table(results.values()))
    scored = board[board.drop(columns="policy").ne(ABSENT).any(axis=1)]
    is_policy = scored.policy.str.startswith("`")
    shown = scored.where(is_policy, scored.replace(r" \(.*", "", regex=True))
    return _unpadded(shown).replace("% to ", "-").replace("%", "")


def _unpadded(table: pd.DataFrame) -> str:
    """A table in Markdown, without the padding of `markdown_table`."""
    rows = [[*table], ["---"] * len(table.columns), *table.values.tolist()]
    return "\n".join(f"|{'|'.join(row)}|" for row in rows)


def _beside_the_paper() -> str:
    """Percent of episodes that the paper's policies solved, and those here by the protocol `standard`, and means over tasks."""
    if not LEADERBOARD.is_dir():
        return NO_RESULTS
    solved = pd.DataFrame({task: row["solved_percent"] for task, row in PAPER.items()}).T
    solved = solved.rename(columns=POLICIES)
    table: Any = results_table(read_results(LEADERBOARD).values())
    for policy, lines in table[table.protocol == "standard"].groupby("policy"):
        if {*lines.task} == {*solved.index}:
            percent = lines.rate.map(lambda rate: 100 * rate.rate)
            solved[f"here: {POLICIES.get(policy, policy)}"] = percent.groupby(lines.task).mean()
    solved.loc["mean"] = solved.mean()
    return markdown_table(solved.map("{:.3g}".format).rename_axis("task").reset_index())


def _ablation() -> str:
    """Episodes that PerAct2 solves in `standard`, by all its trainings and by one with a change; p of the test in brackets."""
    rows: dict[str, dict[str, str]] = {"nothing": {}}
    board = [row for row in read_results(LEADERBOARD).values() if isinstance(row, BenchmarkResult)]
    identity = attrgetter("eval_key", "policy_id", "config.protocol")
    for path in sorted(ABLATION.glob("*/*.json")):
        changed, namesake = BenchmarkResult.read(path), BenchmarkResult.read(LEADERBOARD / path.name)
        usual = tuple(row for row in board if identity(row) == identity(namesake))
        both, task = Comparison((changed,), usual), f"`{changed.task}`"
        (now,), before = both.rates
        usually = namesake.config.training
        flags = {name: value for name, value in changed.config.training.items() if value != usually.get(name)}
        words = (f"{name.removeprefix('policy.')}={json.dumps(value)}" for name, value in flags.items())
        rows["nothing"][task] = ", ".join(str(rate.successes) for rate in before)
        rows.setdefault(f"`{' '.join(words)}`", {})[task] = f"{now.successes} ({both.p_value:.2g})"
    return _unpadded(pd.DataFrame(rows).T.rename_axis("changed").reset_index())


def _tasks() -> str:
    specs = sorted((get_task(name).spec for name in list_tasks()), key=lambda spec: spec.id)
    rows = {
        "task": [f"`{spec.name}`" for spec in specs],
        "instruction": [f"`{spec.instructions[0]}`" for spec in specs],
        "variations": [str(len(spec.variations)) for spec in specs],
        "suites": [", ".join(spec.suites) for spec in specs],
    }
    return markdown_table(pd.DataFrame(rows), True)


def _axes() -> str:
    axes = sorted(AXES.all().values(), key=lambda axis: axis.group)
    rows = {
        "axis": [f"`{axis.name}`" for axis in axes],
        "group": [axis.group for axis in axes],
        "what is different": [axis.summary for axis in axes],
        "levels 1, 2, 3": [
            f"{', '.join(f'{level:g}' for level in axis.levels)} {axis.unit}" for axis in axes
        ],
    }
    return markdown_table(pd.DataFrame(rows), True)


TABLES = {
    "results": ("README.md", _results),
    "paper": ("docs/comparison.md", _beside_the_paper),
    "ablation": ("docs/learning.md", _ablation),
    "tasks": ("docs/training.md", _tasks),
    "axes": ("docs/robustness.md", _axes),
}
"""By name: the page that holds the table, and what writes it."""

if __name__ == "__main__":
    main()
