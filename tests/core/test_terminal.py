"""Tables in the terminal cut no word, however narrow it is."""

import pandas as pd
import pytest

from lerobot_bimanual.terminal import print_table

TABLE = pd.DataFrame(
    [("take_tray_out_of_oven", "48 of 50 (86% to 99%)", "a reason in many words"), ("lift_ball", 1, "")],
    columns=["task", "first policy", "second policy"],
)


@pytest.mark.parametrize("columns", [80, 60, 30])
def test_a_table_is_as_wide_as_the_terminal_allows(columns, capsys, monkeypatch, snapshot):
    monkeypatch.setenv("COLUMNS", str(columns))
    print_table(TABLE, "a title of several words")
    printed = capsys.readouterr().out
    assert {word for cell in TABLE.to_numpy().flat for word in str(cell).split()} <= set(printed.split())
    assert printed == snapshot
