"""Policies side by side on the same episodes, trained once or several times, on one task or several."""

import copy
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from made_up_rows import ROW, VERSIONS, put, recorded, row_of
from rich.console import Console

from lerobot_bimanual.benchmark.pairing import Comparison, Pairing
from lerobot_bimanual.benchmark.pipeline import Command
from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_bimanual.benchmark.run import play_until_sure, run
from lerobot_bimanual.commands.results_compare import ResultsCompareConfig, results_compare
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.results.statistics import anytime_p_value, mcnemar_p_value


def test_episodes_are_paired_by_seed():
    other = copy.copy(ROW)
    object.__setattr__(other, "episodes", recorded("x.x.x", first_seed=1))
    # Seeds 1, 2 and 3 are shared: the first solved 1, the second 1 and 3.
    assert Comparison((ROW,), (other,)).pairing == Pairing(both=1, only_first=0, only_second=1, neither=1)


@pytest.mark.parametrize(
    ("difference", "message"),
    [
        ({"task": "push_box"}, "differ in task: 'lift_ball' and 'push_box'"),
        ({"world": "ba9876543210"}, "world 0123456789ab for one result and ba9876543210 for the other"),
        ({"variation": "0"}, "differ in variation"),
        ({"versions": VERSIONS | {"mujoco": "4"}}, "mujoco was 3 for one result and 4 for the other"),
        ({"episodes": recorded("xx", first_seed=50)}, "share no seed"),
    ],
)
def test_only_the_same_episodes_are_compared(difference, message):
    other = copy.copy(ROW)  # whatever else it would contradict
    for name, value in difference.items():
        object.__setattr__(other, name, value)
    with pytest.raises(BimanualError, match=message):
        Comparison((ROW,), (other,))


def test_compare_prints_both_rates_and_the_test_and_cuts_no_name(tmp_path: Path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    long = tmp_path / f"{'long' * 20}.json"
    long.write_text(ROW.to_json())
    results_compare(ResultsCompareConfig(first=long, second=long))
    assert capsys.readouterr().out.count(str(long)) == 2
    (tmp_path / "one.json").write_text(ROW.to_json())
    (tmp_path / "two.json").write_text(row_of("act", "lift_ball", episodes=recorded("...x")).to_json())
    results_compare(ResultsCompareConfig(first=tmp_path / "one.json", second=tmp_path / "two.json"))
    printed = capsys.readouterr().out
    assert "2 of 4" in printed
    assert "1 of 4" in printed
    assert "only the first 2, only the second 1, neither 1; McNemar's exact test: p = 1" in printed


def trained(seed: int, outcomes: str, policy: str = "mine", task: str = "lift_ball") -> ResultRow:
    row = row_of(policy, task)
    flags = row.flags | {"seed": str(seed)}
    return replace(row, flags=flags, episodes=recorded(outcomes), checkpoint_sha256=f"{seed:064x}")


def test_the_spread_of_episodes_and_that_of_trainings_are_told_apart():
    first = (trained(1, "xxxx"), trained(2, "xx.."))
    second = (trained(1, "x...", "other"), trained(2, "x...", "other"))
    comparison = Comparison(first, second)
    assert comparison.difference == pytest.approx(0.75 - 0.25)
    # By episode the difference is 0, 1, 0.5 and 0.5; the first's trainings differ by a half, the second's not at all.
    assert comparison.episode_error == pytest.approx((0.5 / 3) ** 0.5 / 2)
    assert comparison.training_error == pytest.approx((0.125 / 2) ** 0.5)
    assert comparison.pairing is None
    assert comparison.better == (3, 0)
    assert Comparison(first[:1], second).training_error is None


def test_trainings_on_the_same_episodes_are_no_further_episodes():
    first, second = (trained(1, "xxx."), trained(2, "xx.x")), (trained(1, "...x", "other"),)
    once, twice = Comparison(first[:1], second), Comparison(first, second)
    assert once.test == "McNemar's exact test"
    assert once.p_value == pytest.approx(mcnemar_p_value(3, 1))
    assert twice.test == "the exact sign-flip permutation test"
    # In halves of a success the differences are 2, 2, 1 and -1; of 16 choices of their signs six reach 4 or -4.
    assert twice.p_value == pytest.approx(6 / 16)
    alike = Comparison((first[0], trained(3, "xxx.")), (second[0], trained(4, "...x", "other")))
    assert alike.p_value == pytest.approx(once.p_value)


def test_a_row_twice_is_no_second_training(tmp_path):
    put(tmp_path, trained(1, "xxxx"))
    (tmp_path / "again.json").write_text(trained(1, "xxxx").to_json())
    with pytest.raises(
        BimanualError, match=r"seed1\.json: it has the weights of .*again\.json.*leave one out"
    ):
        results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))


def test_one_network_may_play_several_tasks_and_each_be_compared(tmp_path, capsys):
    for task in ("lift_ball", "push_box"):
        put(tmp_path, trained(1, "xxxx", task=task))
    results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))
    assert capsys.readouterr().out.count("McNemar's exact test: p = 1") == 2


def test_of_several_trainings_it_is_said_on_how_many_episodes_either_is_better(tmp_path, capsys):
    for seed, outcomes in ((1, "xxx."), (2, "xx.x")):
        put(tmp_path, trained(seed, outcomes))
    put(tmp_path, trained(1, "...x", "other"))
    results_compare(
        ResultsCompareConfig(first=tmp_path, second=tmp_path, first_policy="mine", second_policy="other")
    )
    assert (
        "lift_ball: the first is better on 3 episodes, the second on 1, equal on 0; the exact sign-flip permutation test: p ="
        in capsys.readouterr().out
    )


def test_a_stopped_test_is_not_compared_with_several_trainings():
    stopped = replace(trained(2, "xxxx"), stopped_against="0f" * 32)
    with pytest.raises(BimanualError, match=r"--stop_when_sure .* but here are 2 and 1 on lift_ball"):
        Comparison((trained(1, "xxxx"), stopped), (trained(1, "....", "other"),))
    assert Comparison((stopped,), (trained(1, "....", "other"),)).p_value == anytime_p_value(4, 0)


def test_several_tasks_are_compared_at_once_and_corrected_for_their_number(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    for task in ("lift_ball", "push_box"):
        for policy, outcomes in (("mine", "xxxx"), ("other", "....")):
            put(tmp_path, trained(7, outcomes, policy, task))
    config = ResultsCompareConfig(first=tmp_path, second=tmp_path, first_policy="mine", second_policy="other")
    results_compare(config)
    printed = capsys.readouterr().out
    for task in ("lift_ball", "push_box"):
        (line,) = [line for line in printed.splitlines() if task in line and "±" in line]
        assert re.split(" {2,}", line)[3:] == [
            "+100.0% ± 0.0% (episodes)",
            "4, 0",
            "0.125",
            "0.25",
        ]
    assert "A single training of a policy does not say" in printed


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"recipe": "paper"}, "recipe of mine is 'small', but 'paper' in"),
        ({"flags": {"log_freq": "9"}}, "flag log_freq of mine on lift_ball is '9', but '1' in"),
        (
            {"dataset": replace(ROW.dataset, command=f"{ROW.dataset.command} --depth=false")},
            "demonstrations' flags of mine on lift_ball is .*depth",
        ),
        (
            {"dataset": replace(ROW.dataset, command=f"{ROW.dataset.command} --perturb=mass:1")},
            r"several policies; choose one with --first_policy=mine\|mine_mass1",
        ),
    ],
)
def test_only_trainings_that_differ_in_nothing_but_their_seed_are_those_of_one_policy(
    changes, message, tmp_path
):
    put(tmp_path, trained(1, "xxxx"))
    other = trained(2, "....")
    changes = changes | {"flags": other.flags | changes.get("flags", {})}
    put(tmp_path, replace(other, **changes))
    with pytest.raises(BimanualError, match=message):
        results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path))


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        ({}, "several policies; choose one with --first_policy=mine|other"),
        ({"first_policy": "third"}, "first_policy is 'third', but must be one of: mine, other"),
    ],
)
def test_which_policy_of_a_folder_is_meant_must_be_said(flags, message, tmp_path):
    put(tmp_path, trained(7, "xxxx"))
    put(tmp_path, trained(7, "xxxx", "other"))
    with pytest.raises(BimanualError, match=message.replace("|", r"\|")):
        results_compare(ResultsCompareConfig(first=tmp_path, second=tmp_path, **flags))


def test_folders_that_share_no_task_are_refused(tmp_path):
    for folder, tasks in (("one", ("lift_ball", "push_box")), ("two", ("lift_tray",))):
        (tmp_path / folder).mkdir()
        for task in tasks:
            put(tmp_path / folder, trained(7, "xxxx", task=task))
    with pytest.raises(
        BimanualError, match=r"no task is in both: lift_ball, push_box in .*one, lift_tray in"
    ):
        results_compare(ResultsCompareConfig(first=tmp_path / "one", second=tmp_path / "two"))


class MadeUpEvaluations:
    """Stands for a pipeline: every evaluation ends as it is told."""

    def __init__(self, plan: Plan, outcomes: str):
        self.plan, self.outcomes, self.ran = plan, outcomes, 0

    def run(self, command: Command) -> None:
        self.ran += 1
        flags = dict(word.removeprefix("--").split("=", 1) for word in command.words[1:])
        first, folder = int(flags["seed"]), Path(flags["output_dir"])
        part = self.outcomes[first : first + int(flags["eval.n_episodes"])]
        folder.mkdir(parents=True)
        successes = {"metrics": {"successes": [letter == "x" for letter in part]}}
        (folder / "eval_info.json").write_text(json.dumps({"per_task": [successes]}))
        record = replace(ROW.evaluation, episodes=recorded(part, first_seed=first))
        record.write(folder / "lift_ball_test_record.json")


@pytest.mark.parametrize(("outcomes", "played"), [("x" * 40, 10), ("." * 20 + "x" * 20, 30), ("." * 40, 40)])
def test_a_test_goes_on_until_it_is_sure_or_over(outcomes, played, tmp_path):
    config = BenchmarkConfig(output=tmp_path, test_episodes=40, stop_when_sure=Path("rival.json"))
    plan = Plan.of(config)
    pipeline = MadeUpEvaluations(plan, outcomes)
    rival = copy.copy(ROW)
    object.__setattr__(rival, "episodes", recorded("." * 40))
    record = play_until_sure(plan, pipeline, 4, rival)  # pyright: ignore[reportArgumentType]
    assert len(record.episodes) == played == 10 * pipeline.ran


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"test_episodes": 6}, r"rival\.json has not played the seeds \[4, 5\]"),
        ({"task": "push_box"}, r"rival\.json is of the task 'lift_ball', but must be of 'push_box'"),
        ({"variation": "0"}, r"rival\.json is of the variation 'any', but must be of '0'"),
        ({"perturb": "mass:1"}, r"rival\.json is of the perturb '', but must be of 'mass:1'"),
        ({"stop_when_sure": Path("nowhere.json")}, r"nowhere\.json: .*No such file"),
    ],
)
def test_a_rival_that_cannot_be_compared_with_is_refused_before_anything_runs(changes, message, tmp_path):
    (tmp_path / "rival.json").write_text(ROW.to_json())
    asked = {"test_episodes": 4, "stop_when_sure": tmp_path / "rival.json", "output": tmp_path / "out"}
    plan = Plan.of(BenchmarkConfig(**(asked | changes)))
    with pytest.raises(BimanualError, match=message):
        run(plan, Console())
    assert not (tmp_path / "out").exists()
