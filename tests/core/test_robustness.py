"""Robustness results: what files may hold, which conditions count, and how two results are paired."""

import pytest
from sample_robustness import EXPERT_REPORT, ROBUSTNESS, condition

from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.reports.robustness import conditions_table, print_robustness
from lerobot_bimanual.results.record import BadRecord
from lerobot_bimanual.results.robustness import RobustnessResult, is_valid, read_expert_robustness
from lerobot_bimanual.results.statistics import SuccessRate, holm


def test_the_report_counts_what_it_lists_and_each_condition_is_compared_with_the_nominal_one():
    table = conditions_table(ROBUSTNESS).set_index("condition")
    assert (table.lost["camera_moved:2"], table.won["camera_moved:2"]) == (6, 0)
    pair = ["camera_moved:2", "mass:2"]
    assert [*table.p[pair]] == [2 / 64, 2 / 4]
    assert [*table.p_holm[pair]] == holm([*table.p[pair]])
    assert table.p_holm["camera_moved:3"] == 2 / 1024  # the only valid one of its level
    assert table.p_holm[["nominal", "mass:3"]].isna().all()
    assert not table.valid["mass:3"]
    rates = EXPERT_REPORT.rates(EXPERT_REPORT.by_key["mass", 1])
    assert rates == {"expert": SuccessRate(97, 100), "open_loop": SuccessRate(1, 30)}
    valid = [is_valid(EXPERT_REPORT.rates(each)["expert"]) for each in EXPERT_REPORT.conditions]
    assert valid == [True, True, False]
    few = "x" * 9 + "."
    assert not condition("mass", 1, few, expert=few).is_valid
    assert condition("mass", 1, few, expert=few, expert_report=SuccessRate(97, 100)).is_valid
    assert not condition("mass", 1, few, expert_report=SuccessRate(96, 100)).is_valid


def test_what_is_printed_of_a_result_sums_valid_conditions(capsys):
    print_robustness(ROBUSTNESS)
    printed = " ".join(capsys.readouterr().out.split())
    assert "camera_moved:2 5 4 17% to 69% 10 0 6, 0 0.0312 0.0625" in printed
    assert "level 0: 10 of 10; level 1: 19 of 20; level 2: 12 of 20; level 3: 0 of 10" in printed
    assert "in no sum: mass:3" in printed


@pytest.mark.parametrize(
    ("conditions", "complaint"),
    [
        ((), "nominal condition must come first"),
        (ROBUSTNESS.conditions[1:], "nominal condition must come first"),
        ((*ROBUSTNESS.conditions, condition("wind", 1, "x")), "wind:1 must be on the 10 seeds from 0 on"),
    ],
)
def test_conditions_that_do_not_belong_together_are_refused(conditions, complaint):
    with pytest.raises(BadRecord, match=complaint):
        RobustnessResult.of(**{**dict(ROBUSTNESS), "conditions": conditions})


def test_a_folder_of_expert_reports_holds_one_per_task(tmp_path):
    with pytest.raises(BimanualError, match="expert evaluate --axes=all"):
        read_expert_robustness(tmp_path)
    for name in ("one", "other"):
        EXPERT_REPORT.write(tmp_path / f"{name}.json")
    with pytest.raises(BimanualError, match="another report of lift_ball"):
        read_expert_robustness(tmp_path)
