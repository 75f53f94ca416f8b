"""Charts show the numbers of the results, say them in words, and can be read without colours."""

from pathlib import Path

import pytest
from PIL import Image
from sample_results import trained

from lerobot_bimanual.reports.success_figure import Chart, success_figure
from lerobot_bimanual.results.statistics import wilson_interval


def points(chart: Chart) -> list[list[float]]:
    """Horizontal places of all markers of the first panel, line by line."""
    return [list(map(float, line.get_xdata())) for line in chart.figure.axes[0].get_lines()]


def test_the_line_of_a_policy_is_the_interval_of_its_episodes_and_its_marker_the_rate():
    chart = success_figure([trained("xx..", policy="mine")])
    (ends,) = chart.figure.axes[0].collections[0].get_segments()
    assert ends[:, 0] == pytest.approx(wilson_interval(2, 4))
    assert points(chart) == [[0.5], [1.0], [0.25]]


def test_single_trainings_are_drawn_beside_their_mean():
    chart = success_figure([trained("xxxx", policy="mine", seed=1), trained("....", policy="mine", seed=2)])
    assert points(chart)[:2] == [[0.5], [1.0, 0.0]]


def test_a_chart_says_in_words_what_it_shows(snapshot):
    chart = success_figure([trained("xx..", policy="mine", seed=seed) for seed in range(5)])
    assert chart.description == snapshot


def test_a_saved_chart_holds_its_description(tmp_path: Path):
    chart = success_figure([trained("xx..", policy="mine"), trained("xx..", policy="mine", task="a" * 50)])
    chart.save(tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as image:
        assert image.info["Description"] == chart.description
