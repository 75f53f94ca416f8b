"""Tables in the terminal cut no word, however narrow it is."""

import pytest

from lerobot_bimanual.terminal_table import print_table

HEADINGS = ("task", "first policy", "second policy")
ROWS = [("take_tray_out_of_oven", "48 of 50 (86% to 99%)", "a reason in many words"), ("lift_ball", 1, "")]


def test_a_table_that_fits_has_a_line_per_row_and_its_columns_are_aligned(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    print_table(HEADINGS, ROWS, "title")
    title, heading, rule, *rows = capsys.readouterr().out.splitlines()
    assert title == "title"
    assert len(rows) == len(ROWS)
    assert heading.index("first policy") + len("first policy") == rows[0].index(")") + 1
    assert set(rule) == {"-", " "}


@pytest.mark.parametrize("columns", [60, 40, 20])
def test_a_table_that_does_not_fit_has_a_paragraph_per_row(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    print_table(HEADINGS, ROWS)
    printed = capsys.readouterr().out
    words = {word for row in ROWS for cell in row for word in str(cell).split()}
    assert words <= set(printed.split())
    longest = max(map(len, words)) + len("    second policy  ")
    assert all(len(line) <= max(columns, longest) for line in printed.splitlines())
    assert printed.count("task: ") == len(ROWS)


def test_a_file_has_no_width(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr("sys.__stdout__", None)
    print_table(HEADINGS, [("x" * 300, "y" * 300, "z" * 300)])
    assert len(capsys.readouterr().out.splitlines()) == 3
