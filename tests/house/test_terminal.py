"""Tables in a narrow terminal show every name whole."""

import re
from pathlib import Path

import pytest

from lerobot_bimanual import cli
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

LEADERBOARD = Path(__file__).parents[2] / "results/leaderboard"


@pytest.mark.parametrize("columns", [80, 60])
def test_task_list_shows_every_name_and_suite_whole(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert cli.main(["task", "list"]) == 0
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= columns
    words = set(re.split(r"[\s,]+", printed))
    for name in list_tasks():
        assert {name, *get_task(name).spec.taxonomy.suites} <= words


@pytest.mark.parametrize("columns", [80, 60])
def test_results_compare_shows_every_task_whole(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    words = [f"--first={LEADERBOARD}", "--first_policy=peract2", f"--second={LEADERBOARD}"]
    assert cli.main(["results", "compare", *words, "--second_policy=rvt_lf"]) == 0
    names = {path.name.partition("_rvt_lf")[0] for path in LEADERBOARD.glob("*_rvt_lf_*.json")}
    assert names <= set(re.split(r"[\s:]+", capsys.readouterr().out))
