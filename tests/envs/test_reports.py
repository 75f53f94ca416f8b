"""Tables from expert reports."""

import shutil
from pathlib import Path

import pytest

from lerobot_bimanual.errors import BimanualError
from lerobot_env_bimanual.commands.expert_report import ExpertReportConfig, expert_report
from lerobot_env_bimanual.reports.expert_tables import ExpertReports, movable_items, success_table

ROOT = Path(__file__).parents[2]


def test_movable_items_are_free_objects_doors_drawers_and_buttons():
    assert movable_items("lift_ball") == 1
    assert movable_items("lift_tray") == 2  # tray and cube
    assert movable_items("put_item_in_drawer") == 4  # three drawers and the item


def test_the_page_in_the_documentation_is_what_the_reports_say(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    expert_report(ExpertReportConfig(output=tmp_path / "tasks.md"))
    assert (tmp_path / "tasks.md").read_text() == (ROOT / "docs" / "tasks.md").read_text()


def test_what_was_not_played_is_marked(tmp_path):
    shutil.copy(ROOT / "results" / "expert_reports" / "expert.json", tmp_path)
    rows = success_table(ExpertReports.read(tmp_path)).set_index("task")
    assert [*rows.loc["`push_box`"]] == ["100/100", *["–"] * 5]


def test_a_folder_without_reports_is_refused_with_the_command_that_writes_them(tmp_path):
    with pytest.raises(BimanualError, match="expert evaluate --variation=each"):
        expert_report(ExpertReportConfig(expert_reports=tmp_path))
