"""Figures of results say in pixels and in words what the rows say, and can be read without colours."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from made_up_rows import played, put, recorded, row_of
from PIL import Image

from lerobot_bimanual.benchmark import difference_figure as difference
from lerobot_bimanual.benchmark import success_figure as success
from lerobot_bimanual.benchmark.pairing import Comparison
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.canvas import BLUE, DESCRIPTION, ORANGE, PAPER, PIXELS, WIDTH, Canvas, Color
from lerobot_bimanual.commands.results_compare import ResultsCompareConfig, results_compare
from lerobot_bimanual.commands.results_leaderboard import ResultsLeaderboardConfig, results_leaderboard
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.results.statistics import wilson_interval


def trained(policy: str, outcomes: str, seed: int = 1, task: str = "lift_ball") -> ResultRow:
    row = row_of(policy, task)
    flags = row.flags | {"seed": str(seed)}
    count = len(outcomes)
    beside = {"expert": played("x" * count), "blind": played("x" + "." * (count - 1))}
    return replace(row, flags=flags, episodes=recorded(outcomes), checkpoint_sha256=f"{seed:064x}", **beside)


def columns(canvas: Canvas, color: Color, left: float, right: float) -> np.ndarray:
    """Where between two edges a colour stands, in pixels of the layout."""
    found = (np.asarray(canvas.image()) == color).all(axis=-1).any(axis=0).nonzero()[0] / PIXELS
    return found[(found > left) & (found < right)]


def test_the_line_of_a_policy_is_the_interval_of_its_episodes_and_its_mark_the_rate():
    canvas = success.success_figure([trained("mine", "xx..")])
    assert canvas.description == "Successes. lift_ball: mine 2 of 4; expert 4 of 4; blind 1 of 4."
    drawn = columns(canvas, success.STYLES[0][1], success.LEFT - 5, success.RIGHT + 5)
    low, high = (success.LEFT + share * (success.RIGHT - success.LEFT) for share in wilson_interval(2, 4))
    assert drawn.min() == pytest.approx(low, abs=1)
    assert drawn.max() == pytest.approx(high, abs=1)


def test_single_trainings_stand_apart_from_the_interval_of_the_episodes():
    alike = success.success_figure([trained("mine", "xx..", 1), trained("mine", "xx..", 2)])
    apart = success.success_figure([trained("mine", "xxxx", 1), trained("mine", "....", 2)])
    color = success.STYLES[0][1]
    near, far = (columns(canvas, color, success.LEFT - 9, success.RIGHT + 9) for canvas in (alike, apart))
    assert near.min() > success.LEFT + 9
    assert (
        far.min() < success.LEFT < success.RIGHT < far.max()
    )  # marks at 0 and 100 %, where the line does not reach
    assert "mine 4, 0 of 4" in apart.description
    five = success.success_figure([trained("mine", "xx..", seed) for seed in range(5)])
    assert "mine 50% of 4, 5 times" in five.description


def test_a_figure_grows_with_its_tasks_and_holds_long_names():
    one, long = ([trained("mine", "xx..", task=task)] for task in ("lift_ball", "a" * 300))
    canvas = success.success_figure([*one, *long])
    assert canvas.image().width == WIDTH * PIXELS
    assert canvas.image().height > success.success_figure(one).image().height


def test_policies_differ_in_their_marks_or_in_how_bright_they_are():
    brightness = {color: np.dot(color, (0.299, 0.587, 0.114)) for _, color in success.STYLES}
    for (mark, color), (other_mark, other) in combinations(success.STYLES, 2):
        assert mark != other_mark or abs(brightness[color] - brightness[other]) > 40


def test_a_difference_is_drawn_with_both_errors_and_marked_if_it_is_sure():
    many = {
        "surely": Comparison((trained("mine", "x" * 20),), (trained("other", "." * 20),)),
        "perhaps": Comparison((trained("mine", "xxx."),), (trained("other", "x..x"),)),
    }
    canvas = difference.difference_figure(many)
    assert canvas.description == (
        "Success, first (mine) less second (other). surely: +100.0%, p (Holm) 3.81e-06. perhaps: +25.0%, p (Holm) 1."
    )
    pixels = np.asarray(canvas.image())
    axis = difference.LEFT, difference.RIGHT
    for number, (share, color) in enumerate(((1.0, BLUE), (0.25, PAPER))):  # the axis ends at one
        x = np.interp(share, (-1, 1), axis)
        y = difference.TOP + difference.LINE * (number + 0.5)
        assert tuple(pixels[round(y * PIXELS) + 1, round(x * PIXELS) + 1]) == color
    assert not columns(canvas, ORANGE, *axis).size
    twice = Comparison(
        (trained("mine", "xxxx", 1), trained("mine", "xx..", 2)),
        (trained("other", "x...", 1), trained("other", "....", 2)),
    )
    several = difference.difference_figure({"lift_ball": twice})
    assert columns(several, ORANGE, *axis).size
    assert columns(several, BLUE, *axis).size


def test_the_verbs_write_figures_that_describe_themselves(tmp_path: Path, install_recipe):
    results, figures = tmp_path / "results", tmp_path / "figures"
    results.mkdir()
    for policy in ("mine", "other"):
        install_recipe(policy)
        put(results, row_of(policy, "lift_ball"))
    page = tmp_path / "pages" / "page.md"
    results_leaderboard(
        ResultsLeaderboardConfig(results=results, output=page, figure=figures / "all of them.png")
    )
    assert "](../figures/all%20of%20them.png)" in page.read_text()
    policies = {"first_policy": "mine", "second_policy": "other"}
    results_compare(
        ResultsCompareConfig(first=results, second=results, figure=figures / "two.png", **policies)
    )
    for name, words in (
        ("all of them.png", "lift_ball: mine 2 of 4"),
        ("two.png", "first (mine) less second"),
    ):
        with Image.open(figures / name) as picture:
            assert words in picture.info[DESCRIPTION]
            assert picture.width == WIDTH * PIXELS


def test_a_figure_under_the_name_of_another_kind_of_file_is_refused(tmp_path: Path):
    with pytest.raises(InvalidChoice, match=r"figure is '.*all\.pdf', but must be a path that ends in \.png"):
        results_leaderboard(ResultsLeaderboardConfig(results=tmp_path, figure=tmp_path / "all.pdf"))


def test_a_text_that_is_too_long_ends_where_its_room_does():
    canvas = Canvas(20, "")
    canvas.text(10, 10, "m" * 100_000, (0, 0, 0), room=100)
    assert columns(canvas, (0, 0, 0), 0, WIDTH).max() <= 110
