"""Pages of results: what does not belong together is refused, and tables are those of the results; tables in the terminal."""

import re
from pathlib import Path

import pandas as pd
import pytest
from sample_results import RESULT, proved, put, reported, trained, variant
from sample_robustness import EXPERT_REPORT

from lerobot_bimanual.cli import main
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.reports.benchmark_page import benchmark_page, read_results
from lerobot_bimanual.reports.robustness import expert_robustness_page
from lerobot_bimanual.terminal import print_table


@pytest.fixture
def results(tmp_path: Path, install_recipe) -> Path:
    """Three of the four results of two policies on two tasks."""
    folder = tmp_path / "results"
    folder.mkdir()
    for policy in ("mine", "other"):
        install_recipe(policy)
    for policy, task in (("mine", "lift_ball"), ("other", "lift_ball"), ("mine", "push_box")):
        put(folder, variant(config={"policy": policy, "task": task}))
    return folder


def another_training(results: Path, config: dict | None = None, **fields) -> Path:
    config = {"seed": 7} | (config or {})
    return put(results, variant(config=config, **{"checkpoint_sha256": "1f" * 32} | fields))


def page_of(results: Path) -> str:
    page = benchmark_page(read_results(results), results)
    return page.replace(results.as_posix(), "RESULTS")


def test_a_page_of_benchmarks_has_a_line_per_task_and_a_column_per_policy(results: Path, snapshot):
    another_training(results, episodes=proved("xxxx"))
    put(results, variant(config={"policy": "theirs"}))  # which is not installed
    assert page_of(results) == snapshot


def test_a_policy_whose_training_is_unknown_is_compared_and_reported(results: Path, capsys):
    record, place = RESULT.evaluation.model_copy(update={"policy": {"type": "alone"}}), results / "alone.json"
    record.write(place)
    page = page_of(results)
    assert re.search(r"\| +`alone` \| +`mine` \| +`other` \| +expert", page)
    assert "2/4 (15% to 85%)" in page_of(place)
    assert "recipe" not in page_of(place)
    ours = results / "lift_ball_other_small_seed1000.json"
    assert main(["results", "compare", f"--first={place}", f"--second={ours}"]) == 0
    assert "0, 0" in capsys.readouterr().out
    record.model_copy(update={"options": {"split": "val"}}).write(place)
    assert main(["results", "compare", f"--first={place}", f"--second={ours}"]) == 1
    assert "split is 'test', but 'val' in lift_ball_alone" in capsys.readouterr().err


def test_a_record_is_not_another_training_of_a_benchmarked_policy_and_its_split_is_named(tmp_path: Path):
    put(tmp_path, trained("xxxx"))
    record = RESULT.evaluation.model_copy(update={"policy": {"type": "mine"}})
    record.write(place := tmp_path / "record.json")
    with pytest.raises(BimanualError, match=r"kind of file of mine on lift_ball is 'a re.*but 'a re"):
        page_of(tmp_path)
    record.model_copy(update={"options": {**record.options, "split": "train"}}).write(place)
    assert "successes of `train` episodes" in page_of(place)


def test_protocols_of_one_task_have_tables_of_their_own_in_one_page(tmp_path: Path, install_recipe):
    for policy, config in (("mine", {}), ("other", {"demos": 100, "protocol": "standard"})):
        install_recipe(policy)
        put(tmp_path, trained("xxx.", policy=policy, first_seed=4_000_000 * bool(config), config=config))
    page = page_of(tmp_path)
    assert re.findall("^## `(.*)`$", page, re.MULTILINE) == ["own", "standard"]
    assert "successes of unseen `test` episodes" in page


def test_a_page_says_how_many_episodes_real_arms_would_have_gone_through_where_that_is_known(results: Path):
    assert "real Pandas" not in page_of(results)
    known = tuple(each.model_copy(update={"survived": each.seed > 0}) for each in proved("xxxx"))
    all_known = tuple(each.model_copy(update={"survived": True}) for each in known)
    another_training(results, episodes=known)
    (line,) = re.findall("real Pandas.*?\n(\\| `mine.*?)\n", page_of(results), re.DOTALL)
    assert line.split() == ["|", "`mine`", "|", "75.0%", "|"]
    another_training(results, {"task": "push_box"}, episodes=all_known)
    assert "| 87.5%; `lift_ball` 75% |" in page_of(results)


@pytest.mark.parametrize(
    ("config", "fields", "message"),
    [
        ({"recipe": "paper"}, {}, "recipe"),
        ({}, {"world": "ba9876543210"}, "world of lift_ball"),
        ({}, {"expert": reported("xxx.")}, "expert on lift_ball"),
        ({}, {"open_loop": reported("....")}, "open-loop baseline on lift_ball"),
    ],
)
def test_results_that_are_not_comparable_are_refused(config, fields, message, results: Path):
    put(results, variant(config=config, **fields))
    with pytest.raises(BimanualError, match=rf"lift_ball_.*json: {message}"):
        page_of(results)


@pytest.mark.parametrize(
    ("config", "flags"),
    [
        ({"demos_perturb": "mass:1"}, "--demos=2 --val_episodes=2 --test_episodes=4 --demos_perturb=mass:1`"),
        ({"training": RESULT.config.training | {"policy.more": "a b", "policy.depth": 3.0}}, "more=a b"),
    ],
)
def test_a_page_says_how_a_result_departs_from_todays_recipe(config, flags, results: Path):
    put(results, variant(config=config))
    assert flags in page_of(results)


def test_a_folder_without_results_and_a_result_under_another_name_are_refused(results: Path, tmp_path: Path):
    with pytest.raises(BimanualError, match="holds no results; `lerobot-bimanual policy benchmark` writes"):
        read_results(tmp_path)
    (results / "lift_ball_mine_small_seed1000.json").rename(results / "better.json")
    with pytest.raises(BimanualError, match=r"better\.json: .*must be named lift_ball_mine_small"):
        read_results(results)


def test_a_page_of_expert_robustness_says_which_conditions_are_valid(snapshot):
    assert expert_robustness_page(dict.fromkeys(["a", "b"], EXPERT_REPORT)) == snapshot


TABLE = pd.DataFrame(
    [("take_tray_out_of_oven", "48 of 50 (86% to 99%)", "a reason in many words"), ("lift_ball", 1, "")],
    columns=["task", "first policy", "second policy"],
)


@pytest.mark.parametrize("columns", [80, 60, 30])
def test_a_table_is_as_wide_as_the_terminal_allows(columns, capsys, monkeypatch, snapshot):
    monkeypatch.setenv("COLUMNS", str(columns))
    print_table(TABLE, "a title of several words")
    printed = capsys.readouterr().out
    assert {word for cell in TABLE.to_numpy().flat for word in str(cell).split()} <= set(printed.split())
    assert printed == snapshot
