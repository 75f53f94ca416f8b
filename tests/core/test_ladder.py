"""Ladders: what files may hold, what is counted, and what tables and pictures say of it."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from made_up_ladders import AXES, CERTIFICATE, LADDER, ladder, rung
from PIL import Image

from lerobot_bimanual.commands.results_compare import ResultsCompareConfig, results_compare
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.ladder.result import LadderResult
from lerobot_bimanual.ladder.rung_certificate import RungCertificate, read_rung_certificates
from lerobot_bimanual.reports.drops import drops_of, level_sums
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
    found = drops_of(LADDER)
    assert "level 0" not in found
    assert found["camera_moved:2"].difference == pytest.approx(-0.6)
    pair = [found[name].pairing.p_value for name in ("camera_moved:2", "mass:2")]
    assert pair == [mcnemar_p_value(6, 0), mcnemar_p_value(2, 0)]
    assert [found[name].p_holm for name in ("camera_moved:2", "mass:2")] == holm(pair)


def test_a_rung_that_the_expert_fails_is_counted_nowhere():
    assert not LADDER.by_name["mass:3"].is_certified
    assert drops_of(LADDER)["mass:3"].p_holm is None
    assert drops_of(LADDER)["camera_moved:3"].p_holm == mcnemar_p_value(10, 0)  # alone of its level
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
    assert "second, yours 0f0f0f0f, on lift_ball" in Image.open(figure).info["Description"]


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
