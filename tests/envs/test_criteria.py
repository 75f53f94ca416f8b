"""What a certificate asks of the outcomes of a control, and the rates it counts."""

from dataclasses import replace

import pytest
from made_up_outcomes import FAILED, NO_STRAIN, SOLVED, episodes

from lerobot_env_bimanual.experts.control_names import CONTROLS, EXPERTS
from lerobot_env_bimanual.experts.criteria import MAX_RATES, complaints, rates
from lerobot_env_bimanual.experts.evidence import Evidence


@pytest.mark.parametrize(
    ("discretise", "failed", "enough"), [(0, 1, True), (0, 2, False), (100, 3, True), (100, 4, False)]
)
@pytest.mark.parametrize("control", EXPERTS)
def test_experts_must_succeed_in_99_percent_and_97_percent_rounded(control, discretise, failed, enough):
    found = complaints(control, discretise, episodes(100 - failed, failed))
    assert (found == []) is enough


@pytest.mark.parametrize(
    ("flaw", "complaint"),
    [
        ({"unstable": True}, "unstable"),
        (
            {"keyposes": (replace(SOLVED.keyposes[0], arrived=False, tip_error_mm=(1.0, 30.0)),)},
            "1 and 30 mm",
        ),
        ({"evidence": Evidence(True, False, NO_STRAIN)}, "replay"),
        (
            {"evidence": Evidence(False, True, NO_STRAIN)},
            "keyframe discovery is right in 0 of 1",
        ),
        (
            {"evidence": Evidence(True, True, replace(NO_STRAIN, contact_force_n=554.0))},
            "contact_force_n is 554, but must be at most 100",
        ),
    ],
)
def test_a_solved_episode_with_a_flaw_is_complained_of(flaw, complaint):
    assert complaints("expert", 0, [SOLVED]) == []
    (found,) = complaints("expert", 0, [replace(SOLVED, **flaw)])
    assert complaint in found


def test_what_rounded_keyposes_ask_of_the_arms_is_measured_and_not_limited():
    pressed = replace(
        SOLVED, evidence=replace(SOLVED.evidence, strain=replace(NO_STRAIN, contact_force_n=554.0))
    )
    assert complaints("expert", 100, [pressed]) == []


def test_controls_must_fail():
    assert complaints("noop", 0, episodes(0, 50)) == []
    assert "noop succeeds in 1 of 50" in complaints("noop", 0, episodes(1, 49))[0]
    assert "random succeeds" in complaints("random", 0, episodes(1, 49))[0]
    swept = [replace(outcome, task="put_item_in_drawer") for outcome in episodes(6, 44)]
    assert complaints("random", 0, [*swept[1:], swept[-1]]) == []  # as its file says
    assert "random succeeds in 6 of 50" in complaints("random", 0, swept)[0]
    assert complaints("blind", 0, episodes(10, 40)) == []
    assert "blind succeeds in 11 of 50" in complaints("blind", 0, episodes(11, 39))[0]


def test_what_is_measured_without_a_limit_is_still_not_to_be_unstable():
    for control in ("language_blind",):
        assert complaints(control, 0, episodes(50, 0)) == []
        assert "unstable" in complaints(control, 0, [replace(SOLVED, unstable=True)])[0]


def test_every_control_has_its_limit():
    assert {*EXPERTS, "random", *MAX_RATES} == set(CONTROLS)


def test_rates_are_per_task_and_variation():
    outcomes = [SOLVED, FAILED, replace(SOLVED, variation=1)]
    assert {key: (rate.successes, rate.trials) for key, rate in rates(outcomes).items()} == {
        ("lift_ball", 0): (1, 2),
        ("lift_ball", 1): (1, 1),
    }
