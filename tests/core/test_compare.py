"""Success rates and their intervals, policies side by side on the same episodes, and robustness results."""

import re
from itertools import combinations, product

import numpy as np
import pytest
from sample_results import RESULT, VERSIONS, put, trained, variant
from sample_robustness import EXPERT_REPORT, ROBUSTNESS, condition

from lerobot_bimanual.commands.results_compare import ResultsCompareConfig, results_compare
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.reports.robustness import conditions_table, expert_robustness_page, print_robustness
from lerobot_bimanual.results.benchmark import read_scored
from lerobot_bimanual.results.comparison import Comparison
from lerobot_bimanual.results.record import BadRecord
from lerobot_bimanual.results.robustness import RobustnessResult, is_valid, read_expert_robustness
from lerobot_bimanual.results.statistics import SuccessRate, holm, paired_p_value, wilson_interval

OTHER_VERSIONS = VERSIONS | {"mujoco": "4"}
OTHER_DEMONSTRATIONS = RESULT.demonstrations.model_copy(update={"versions": OTHER_VERSIONS})


def test_episodes_are_paired_by_seed():
    other = trained("x.x.x", first_seed=1)
    # Seeds 1, 2 and 3 are shared: the first solved 1, the second 1 and 3.
    comparison = Comparison((RESULT,), (other,))
    assert ([*comparison.solved[0].index], comparison.better) == ([1, 2, 3], (0, 1))


@pytest.mark.parametrize(
    ("config", "fields", "message"),
    [
        ({"task": "push_box"}, {}, "what is played is 'push_box', but 'lift_ball' in lift_ball_mine"),
        ({}, {"world": "ba9876543210"}, "world is 'ba9876543210', but '0123456789ab' in lift_ball_mine"),
        ({"variation": "0"}, {}, "what is played is 'lift_ball_0'"),
        (
            {},
            {"options": RESULT.options | {"protective_stop": 1}},
            "option protective_stop is 1, but None in lift",
        ),
        ({}, {"versions": OTHER_VERSIONS, "demonstrations": OTHER_DEMONSTRATIONS}, "is .*'mujoco': '4'"),
    ],
)
def test_only_the_same_episodes_are_compared(config, fields, message):
    with pytest.raises(BimanualError, match=message):
        Comparison((RESULT,), (variant(config=config, **fields),))
    with pytest.raises(BimanualError, match="share no seed"):
        Comparison((RESULT,), (trained("xx", first_seed=50),))


def test_the_standard_error_over_episodes_and_the_one_over_trainings_are_computed_separately():
    first = (trained("xxxx", 1), trained("xx..", 2))
    second = (trained("x...", 1, "other"), trained("x...", 2, "other"))
    comparison = Comparison(first, second)
    assert comparison.difference == pytest.approx(0.75 - 0.25)
    # By episode the difference is 0, 1, 0.5, 0.5, and 1 and -1 are added; the first's trainings differ by 0.5, the second's by 0.
    assert comparison.episode_error == pytest.approx((3.5 / 6 - 1 / 9) ** 0.5 / 6**0.5)
    assert comparison.training_error == pytest.approx((0.125 / 2) ** 0.5)
    assert comparison.better == (3, 0)
    assert Comparison(first[:1], second).training_error is None


def test_outcomes_are_exchanged_among_the_trainings_of_an_episode():
    first, second = (trained("xxx.", 1), trained("xx.x", 2)), (trained("...x", 1, "other"),)
    assert Comparison(first[:1], second).p_value == pytest.approx(10 / 16)
    assert Comparison(first, second).p_value == paired_p_value([2, 2, 1, 1], [0, 0, 0, 1], (2, 1))


def test_the_same_weights_are_not_a_second_training_but_may_score_several_tasks(tmp_path, capsys):
    for task in ("lift_ball", "push_box"):
        put(tmp_path, trained("xxxx", task=task))
    results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))
    assert capsys.readouterr().out.count("0, 0") == 2
    trained("xxxx").write(tmp_path / "again.json")
    with pytest.raises(BimanualError, match=r"seed1\.json has the weights of .*again\.json.*remove one"):
        results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))


def test_a_copy_of_a_record_is_not_a_second_training(tmp_path):
    for name in ("one", "two"):
        RESULT.evaluation.model_copy(update={"policy": {"type": "mine"}}).write(tmp_path / f"{name}.json")
    with pytest.raises(BimanualError, match=r"two\.json has the episodes of .*one\.json"):
        results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))


def test_several_tasks_are_compared_at_once_and_corrected_for_their_number(tmp_path, capsys):
    for task in ("lift_ball", "push_box"):
        for policy, outcomes in (("mine", "xxxx"), ("other", "....")):
            put(tmp_path, trained(outcomes, 7, policy, task))
    config = ResultsCompareConfig(first=tmp_path, second=tmp_path, first_policy="mine", second_policy="other")
    results_compare(config)
    printed = capsys.readouterr().out
    for task in ("lift_ball", "push_box"):
        (line,) = [line for line in printed.splitlines() if task in line and "±" in line]
        assert re.split(" {2,}", line)[3:] == ["+100.0% ± 30.4% (episodes)", "4, 0", "0.125", "0.25"]
    assert "A single training of a policy does not show" in printed


def test_trainings_on_demonstrations_of_different_seeds_count_as_one_policy(tmp_path, capsys):
    seeds = RESULT.demonstrations.settings | {"first_seed": 2000}
    demonstrations = RESULT.demonstrations.model_copy(update={"settings": seeds})
    put(tmp_path, trained("xxxx", 1))
    put(tmp_path, trained("....", 2, config={"first_demo_seed": 2000}, demonstrations=demonstrations))
    results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))
    assert "4, 0 of 4" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("config", "fields", "message"),
    [
        ({"recipe": "paper"}, {}, "recipe of mine is 'small', but 'paper' in"),
        ({"training": {}}, {}, r"settings of mine on lift_ball is .*log_freq.*remove one of the files"),
        ({"training": RESULT.config.training | {"log_freq": 9}}, {}, "log_freq of mine .* is [19], but"),
        (
            {},
            {"demonstrations": RESULT.demonstrations.model_copy(update={"settings": {"first_seed": 1}})},
            "demonstrations' settings of mine on lift_ball is .*depth",
        ),
        ({}, {"options": RESULT.options | {"image_size": 9}}, "options of mine on lift_ball is .*image"),
        ({"demos_perturb": "mass:1"}, {}, r"several policies; choose .*--first_policy=mine\|mine_mass1"),
    ],
)
def test_only_trainings_that_differ_in_their_seed_alone_are_of_one_policy(config, fields, message, tmp_path):
    put(tmp_path, trained("xxxx", 1))
    put(tmp_path, trained("....", 2, config=config, **fields))
    with pytest.raises(BimanualError, match=message):
        results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))


def test_a_file_of_a_sweep_is_refused_with_the_folder_of_its_records(tmp_path):
    ROBUSTNESS.write(tmp_path / "sweep.json")
    with pytest.raises(BadRecord, match=r"sweep\.json: .*schema_version.*give the folder sweep_records"):
        read_scored(tmp_path / "sweep.json")


@pytest.mark.parametrize(
    ("successes", "trials", "lower", "upper"),
    [
        (60, 60, 0.9398, 1.0),
        (40, 40, 0.9124, 1.0),
        (0, 20, 0.0, 0.1611),
        (50, 100, 0.4038, 0.5962),
        (1, 10, 0.0179, 0.4042),
    ],
)
def test_wilson_interval_has_the_published_values(successes, trials, lower, upper):
    assert wilson_interval(successes, trials) == pytest.approx((lower, upper), abs=5e-5)


@pytest.mark.parametrize(
    ("first", "second"),
    [(["xx.x"], ["...x"]), (["xxx.", "xx.x"], ["...x"]), (["x.x.", "x..x", "xx.."], ["..xx", ".xx."])],
)
def test_the_paired_test_counts_all_signs_and_all_ways_to_deal_out_the_outcomes_of_each_episode(
    first, second
):
    outcomes = np.array([[mark == "x" for mark in marks] for marks in (*first, *second)])
    n, trainings = len(first), len(outcomes)
    seen = abs(outcomes[:n].mean() - outcomes[n:].mean())
    dealt = [
        [
            episode[list(chosen)].sum() / n - np.delete(episode, chosen).sum() / (trainings - n)
            for chosen in combinations(range(trainings), n)
        ]
        for episode in outcomes.T
    ]
    differences = outcomes[:n].mean(axis=0) - outcomes[n:].mean(axis=0)
    flipped = [(each, -each) for each in differences]
    at_least = [
        np.mean([abs(np.mean(each)) > seen - 1e-9 for each in product(*ways)]) for ways in (dealt, flipped)
    ]
    of_episode = outcomes[:n].sum(axis=0).tolist(), outcomes[n:].sum(axis=0).tolist()
    assert paired_p_value(*of_episode, (n, trainings - n)) == pytest.approx(max(at_least))


def test_copies_of_a_training_are_no_evidence():
    first, second = np.array([1, 1, 1, 1, 0, 1, 1]), np.array([0, 1, 0, 0, 1, 0, 0])
    alone = paired_p_value(first.tolist(), second.tolist())
    assert paired_p_value((3 * first).tolist(), (3 * second).tolist(), (3, 3)) == pytest.approx(alone)


def test_holm_corrects_for_the_number_of_questions_and_keeps_the_order():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert holm([]) == []


def test_valid_conditions_are_compared_with_the_nominal_one_and_the_expert_decides_which_are_valid():
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
    assert "left out of the sums: mass:3" in printed


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


def test_expert_reports_without_a_perturbed_condition_or_twice_of_one_task_are_refused(tmp_path):
    with pytest.raises(BimanualError, match="expert evaluate --axes=all"):
        read_expert_robustness(tmp_path)
    nominal = EXPERT_REPORT.model_copy(update={"conditions": EXPERT_REPORT.conditions[:1]})
    nominal.write(tmp_path / "one.json")
    with pytest.raises(BimanualError, match="expert evaluate --axes=all"):
        expert_robustness_page(read_expert_robustness(tmp_path))
    for name in ("one", "other"):
        EXPERT_REPORT.write(tmp_path / f"{name}.json")
    with pytest.raises(BimanualError, match="another report of lift_ball"):
        read_expert_robustness(tmp_path)
