"""Charts show the numbers of the results, say them in words, and can be read without colours."""

from pathlib import Path

import pytest
from PIL import Image
from sample_results import trained
from sample_robustness import ROBUSTNESS, condition, result

from lerobot_bimanual.reports.charts import INK, Chart
from lerobot_bimanual.reports.robustness_figure import heat_map
from lerobot_bimanual.reports.success_figure import success_figure
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


def test_a_heat_map_shows_the_mean_of_trainings_and_hatches_what_is_not_valid():
    changed = (condition("", 0, "xxxxxx...."), *ROBUSTNESS.conditions[1:])
    again = result({"checkpoint_sha256": "1f" * 32}, conditions=changed)
    panel = heat_map({"lift_ball_mine": ROBUSTNESS, "lift_ball_mine_seed2000": again}).figure.axes[0]
    assert [text.get_text() for text in panel.texts] == ["80", "100", "80", "20", "90", "40", "0"]
    assert len(panel.patches) == 1
    assert panel.texts[3].get_color() != INK


def test_charts_say_in_words_what_they_show(snapshot):
    charts = {
        "success": success_figure([trained("xx..", policy="mine", seed=seed) for seed in range(5)]),
        "heat map": heat_map({"a": ROBUSTNESS, "b": result({"policy": "yours", "task": "push_box"})}),
    }
    assert {name: chart.description for name, chart in charts.items()} == snapshot


def test_a_saved_chart_holds_its_description(tmp_path: Path):
    chart = success_figure([trained("xx..", policy="mine"), trained("xx..", policy="mine", task="a" * 50)])
    chart.save(tmp_path / "chart.png")
    with Image.open(tmp_path / "chart.png") as image:
        assert image.info["Description"] == chart.description
