"""What verbs print in a narrow terminal holds every name whole."""

import re
from pathlib import Path

import pytest

from lerobot_bimanual import cli
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

ROOT = Path(__file__).parents[2]


def test_every_table_of_a_verb_is_one_that_cuts_nothing():
    folders = ("lerobot_bimanual", "envs", "policies")
    modules = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert len(modules) > 100
    assert not [path for path in modules if re.search(r"\brich\.table\b", path.read_text(encoding="utf-8"))]


@pytest.mark.parametrize("columns", [80, 60])
def test_tasks_lists_every_name_and_suite_whole(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert cli.main(["task", "list"]) == 0
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= columns
    words = set(re.split(r"[\s,]+", printed))
    for name in list_tasks():
        assert {name, *get_task(name).spec.taxonomy.suites} <= words


@pytest.mark.parametrize("columns", [80, 60])
def test_compare_names_every_file_task_and_figure_whole(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    folder = ROOT / "results/leaderboard"
    sides = (f"--first={folder}", "--first_policy=peract2", f"--second={folder}", "--second_policy=rvt_lf")
    assert cli.main(["results", "compare", *sides]) == 0
    first, second, *table = capsys.readouterr().out.splitlines()
    assert str(folder) in first
    assert str(folder) in second
    names = {path.name.partition("_rvt_lf")[0] for path in folder.glob("*_rvt_lf_*.json")}
    assert names <= set(re.split(r"[\s:]+", "\n".join(table)))
