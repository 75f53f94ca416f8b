"""Ladders: what files may hold, what is counted, and what tables and pictures say of it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_ladders import AXES, CERTIFICATE, LADDER, ladder, rung
from PIL import Image

from lerobot_bimanual.canvas import DESCRIPTION, VERMILION
from lerobot_bimanual.commands.results_compare import ResultsCompareConfig, results_compare
from lerobot_bimanual.commands.results_robustness import ResultsRobustnessConfig, results_robustness
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.ladder import ladders_page
from lerobot_bimanual.ladder.falls import falls, level_sums
from lerobot_bimanual.ladder.heat_map import heat_map
from lerobot_bimanual.ladder.ladder_figure import ladder_figure
from lerobot_bimanual.ladder.result import LadderResult
from lerobot_bimanual.ladder.rung_certificate import RungCertificate, read_rung_certificates
from lerobot_bimanual.results.statistics import SuccessRate, holm, mcnemar_p_value


def changed(path: Path, **changes) -> Path:
    """A file of the ladder in which some fields hold something else."""
    LADDER.write(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    return path


def test_a_ladder_and_a_certificate_come_back_from_their_files(tmp_path):
    for kind, written in ((LadderResult, LADDER), (RungCertificate, CERTIFICATE)):
        written.write(tmp_path / "file.json")
        assert kind.read(tmp_path / "file.json") == written


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"schema_version": 2}, "schema_version is 2, but must be 1"),
        ({"more": 1}, "has unknown more"),
        ({"options": {}}, "must hold split and variation"),
        ({"batch_size": 0}, "batch_size is 0"),
        ({"checkpoint_sha256": "f"}, "64 hexadecimal digits"),
        ({"rungs": []}, "must begin with level 0"),
        ({"axes": []}, "must be of the axes"),
        ({"not_applicable": ["mass"]}, "none of them can have rungs"),
    ],
)
def test_a_file_that_is_no_ladder_is_refused_on_one_line(changes, message, tmp_path):
    path = changed(tmp_path / "damaged.json", **changes)
    with pytest.raises(BimanualError, match=message) as refused:
        LadderResult.read(path)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("rungs", "message"),
    [
        ((rung("", 0, "xx"), rung("mass", 1, "x")), "same seeds"),
        ((rung("", 0, "xx"), rung("mass", 2, "xx"), rung("mass", 1, "xx")), "sorted"),
        ((rung("mass", 1, "xx"),), "begin with level 0"),
    ],
)
def test_rungs_that_cannot_be_paired_are_refused(rungs, message):
    with pytest.raises(ValueError, match=message):
        ladder(axes=AXES[1:], rungs=rungs)


def test_a_rung_of_no_axis_has_no_level_but_0():
    for axis, level in (("mass", 0), ("", 1), ("mass", 4)):
        with pytest.raises(ValueError, match="level 0 is of no axis"):
            rung(axis, level, "x")


def test_each_rung_is_held_against_level_0_and_corrected_over_the_axes_of_its_level():
    found = falls(LADDER)
    assert "level 0" not in found
    assert found["camera_moved:2"].difference == pytest.approx(-0.6)
    pair = [found[name].p_value for name in ("camera_moved:2", "mass:2")]
    assert pair == [mcnemar_p_value(6, 0), mcnemar_p_value(2, 0)]
    assert [found[name].p_holm for name in ("camera_moved:2", "mass:2")] == holm(pair)


def test_a_rung_that_the_expert_fails_is_counted_nowhere():
    assert not LADDER.by_name["mass:3"].is_certified
    assert falls(LADDER)["mass:3"].p_holm is None
    assert falls(LADDER)["camera_moved:3"].p_holm == mcnemar_p_value(10, 0)  # alone of its level
    assert level_sums(LADDER) == {
        0: SuccessRate(10, 10),
        1: SuccessRate(19, 20),
        2: SuccessRate(12, 20),
        3: SuccessRate(0, 10),
    }


def test_a_certificate_decides_over_the_few_episodes_of_a_ladder():
    few = "x" * 9 + "."
    assert not rung("mass", 1, few, expert=few).is_certified
    assert rung("mass", 1, few, expert=few, certificate=SuccessRate(97, 100)).is_certified
    assert not rung("mass", 1, few, certificate=SuccessRate(96, 100)).is_certified


def test_a_certificate_counts_what_it_lists():
    rates = CERTIFICATE.rates(CERTIFICATE.rungs[1])
    assert rates == {"expert": SuccessRate(97, 100), "blind": SuccessRate(1, 30)}
    assert [CERTIFICATE.is_certified(rung) for rung in CERTIFICATE.rungs] == [True, True, False]


@pytest.mark.parametrize(
    "changes",
    [
        {"expert_seeds": (0, 10**30)},
        {"blind_seeds": (5, 5)},
        {"rungs": CERTIFICATE.rungs[1:]},
        {"rungs": (CERTIFICATE.rungs[0], replace(CERTIFICATE.rungs[1], expert_failed=(7,)))},
        {"axes": AXES},
        {"rungs": (CERTIFICATE.rungs[0], replace(CERTIFICATE.rungs[1], planned_failed=(7,)))},
        {"schema_version": 1},
    ],
)
def test_a_certificate_that_contradicts_itself_is_refused(changes):
    with pytest.raises(ValueError, match="must"):
        replace(CERTIFICATE, **changes)


def test_a_folder_of_certificates_holds_one_per_task(tmp_path):
    with pytest.raises(BimanualError, match="expert evaluate-perturbed"):
        read_rung_certificates(tmp_path)
    for name in ("one", "other"):
        CERTIFICATE.write(tmp_path / f"{name}.json")
    with pytest.raises(BimanualError, match="another certificate of lift_ball"):
        read_rung_certificates(tmp_path)


def test_the_figure_says_in_words_what_it_shows_and_marks_what_is_sure_and_what_is_not_certified():
    canvas = ladder_figure(LADDER)
    assert "camera_moved:2 4 of 10 (expert 10, blind 0), p (Holm) 0.0625." in canvas.description
    assert "mass:3 2 of 10 (expert 4, blind 0), not certified." in canvas.description

    def reds(result: LadderResult) -> int:
        return int((np.asarray(ladder_figure(result).image()) == VERMILION).all(axis=-1).sum())

    assert reds(LADDER) > 0
    harmless = tuple(replace(each, episodes=LADDER.level_0.episodes) for each in LADDER.rungs)
    assert reds(ladder(rungs=harmless)) == 0


def test_figures_grow_with_their_axes_and_ladders_and_hold_one_without_any():
    alone = ladder(axes=(), rungs=LADDER.rungs[:1])
    assert ladder_figure(alone).image().height <= ladder_figure(LADDER).image().height
    assert heat_map({"a": alone}).image().height < heat_map({"a": LADDER}).image().height
    together, apart = {"a": LADDER, "b": LADDER}, {"a": LADDER, "b": ladder(task="push_box")}
    assert heat_map(apart).image().height > heat_map(together).image().height
    many = dict.fromkeys("abcdefghijklm", LADDER)
    assert heat_map(many).image().height > heat_map(dict.fromkeys("abcdefghijkl", LADDER)).image().height


def test_the_heat_map_leaves_out_of_its_words_what_is_not_certified():
    description = heat_map({"a": LADDER, "b": ladder(policy="yours")}).description
    assert description.count("camera_moved:3 0%") == 2
    assert "b, yours 0f0f0f0f, on lift_ball: level 0 100%" in description
    assert "mass:3" not in description


def test_the_heat_map_shows_the_mean_of_trainings():
    again = ladder(checkpoint_sha256="1f" * 32, rungs=(rung("", 0, "xxxxxx...."), *LADDER.rungs[1:-1]))
    description = heat_map({"lift_ball_mine": LADDER, "lift_ball_mine_seed2000": again}).description
    assert description.startswith("mine, 2 trainings, on lift_ball: level 0 80%, camera_moved:1 90%")
    assert description.count("on lift_ball") == 1


def test_compare_pairs_two_ladders_rung_by_rung(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    LADDER.write(tmp_path / "first.json")
    rungs = (*LADDER.rungs[:2], rung("camera_moved", 2, "xxxxxxxxxx"), *LADDER.rungs[4:])
    ladder(rungs=rungs, policy="yours").write(tmp_path / "second.json")
    figure = tmp_path / "both.png"
    results_compare(
        ResultsCompareConfig(first=tmp_path / "first.json", second=tmp_path / "second.json", figure=figure)
    )
    output = " ".join(capsys.readouterr().out.split())
    assert "camera_moved:2 4 10 0, 6 0.0312 0.0625" in output
    assert "mass:3 2 2 0, 0 1 not certified" in output
    assert "certified rungs of level 2: first 12, second 18 of 20" in output
    assert "only one has played: camera_moved:3" in output
    assert "second, yours 0f0f0f0f, on lift_ball" in Image.open(figure).info[DESCRIPTION]


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (ladder(task="push_box"), "differ in task: 'lift_ball' and 'push_box'"),
        (ladder(options=LADDER.options | {"split": "val"}), "differ in split"),
        (ladder(versions=LADDER.versions | {"mujoco": "4"}), "differ in mujoco"),
        (ladder(rungs=(replace(LADDER.rungs[0], world="other"), *LADDER.rungs[1:])), "the world of level 0"),
        (ladder(axes=(), rungs=(rung("", 0, "xx"),)), "differ in seeds"),
    ],
)
def test_only_ladders_of_the_same_episodes_are_compared(other, message, tmp_path):
    LADDER.write(tmp_path / "first.json")
    other.write(tmp_path / "second.json")
    with pytest.raises(BimanualError, match=message):
        results_compare(ResultsCompareConfig(first=tmp_path / "first.json", second=tmp_path / "second.json"))


def test_a_ladder_beside_a_row_is_refused(tmp_path):
    LADDER.write(tmp_path / "first.json")
    (tmp_path / "second.json").write_text('{"policy": "act"}')
    with pytest.raises(BimanualError, match=r"second\.json: ladder lacks"):
        results_compare(ResultsCompareConfig(first=tmp_path / "first.json", second=tmp_path / "second.json"))


def test_robustness_writes_tables_and_a_heat_map(tmp_path):
    folder = tmp_path / "ladders"
    LADDER.write(folder / "mine.json")
    CERTIFICATE.write(tmp_path / "rungs" / "lift_ball.json")
    page, figure = tmp_path / "page.md", tmp_path / "map.png"
    results_robustness(
        ResultsRobustnessConfig(
            ladders=(folder,), certificates=tmp_path / "rungs", output=page, figure=figure
        )
    )
    text = page.read_text()
    assert "| axis | mine |" in text
    assert "| camera_moved (2, 5, 10 degrees) | 9 4 **0** |" in text
    assert "| mass (1.2, 1.5, 2 times the mass) | 10 8 (2) |" in text
    assert "| mass | 1 of 1 |  | 0 of 1 (not lift_ball) |" in text
    assert "| mass (1.2, 1.5, 2 times the mass) | 97/100, 1/30 |  | (96/100, 0/30) |" in text
    assert "mine, mine 0f0f0f0f, on lift_ball" in Image.open(figure).info[DESCRIPTION]


def test_a_page_sums_a_policy_over_its_tasks_where_rungs_are_certified():
    half = ladder(task="push_box", rungs=(rung("", 0, "xxxxx....."), *LADDER.rungs[1:]))
    page = ladders_page.render({"lift_ball_mine": LADDER, "push_box_mine": half, "push_box_yours": half})
    everything = page.split("### lift_ball")[0]
    assert "| axis | mine, 2 tasks |" in everything
    assert "| level 0 | 75% |" in everything
    assert "| camera_moved | 90% 40% 0% |" in everything
    assert "| mass | 100% 80% . |" in everything
    assert "### All tasks" not in ladders_page.render({"lift_ball_mine": LADDER, "push_box_yours": half})


def test_a_page_says_how_far_trainings_of_one_policy_are_apart_beside_other_policies():
    again = ladder(
        checkpoint_sha256="1f" * 32,
        rungs=(LADDER.level_0, rung("camera_moved", 1, "xxxxx....."), *LADDER.rungs[2:]),
    )
    worse = ladder(checkpoint_sha256="2f" * 32, rungs=(rung("", 0, "xxxxxx...."), *LADDER.rungs[1:]))
    trained = {"lift_ball_mine": LADDER, "lift_ball_mine_seed2000": again}
    others = {"lift_ball_yours": worse, "lift_ball_yours_seed7": replace(worse, checkpoint_sha256="3f" * 32)}
    page = ladders_page.render(trained | others).split("### lift_ball")[0]
    assert "| axis | mine | yours |" in page
    assert "| level 0 | 0% | 0% |" in page
    assert "| camera_moved | 40% 0% 0% | 0% 0% 0% |" in page
    assert "| mass | 0% 0% . | 0% 0% . |" in page  # mass:3 is not certified
    # Of the six certified rungs: level 0 differs by 40 % of the episodes, and camera_moved:1 in one pair of two.
    assert "| mine | 7% (40%) | 10% (40%) |" in page
    assert "| yours | 10% (40%) | 0% (0%) |" in page
    copied = ladders_page.render(trained | others | {"lift_ball_mine_seed3000": again})
    assert "| mine | 7% (40%) | 10% (40%) |" in copied
    elsewhere = {
        name.replace("lift_ball", "push_box"): replace(each, task="push_box") for name, each in others.items()
    }
    assert "| mine | 7% (40%) | . |" in ladders_page.render(trained | elsewhere)
    copies = {"lift_ball_mine": LADDER, "lift_ball_mine_seed2000": LADDER}
    assert "Trainings" not in ladders_page.render(copies)  # the same weights are no second training


def test_robustness_without_results_or_with_two_of_one_name_says_so(tmp_path):
    with pytest.raises(BimanualError, match="no results of `lerobot-bimanual policy robustness`"):
        results_robustness(ResultsRobustnessConfig(ladders=(tmp_path,)))
    for folder in ("a", "b"):
        LADDER.write(tmp_path / folder / "mine.json")
    with pytest.raises(BimanualError, match="same name"):
        results_robustness(ResultsRobustnessConfig(ladders=(tmp_path / "a", tmp_path / "b")))
