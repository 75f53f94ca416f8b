"""Results of benchmarks: they survive a file, bad ones are refused, and they stand side by side."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lerobot_bimanual.benchmark.leaderboard import render
from lerobot_bimanual.benchmark.pairing import Pairing, pair
from lerobot_bimanual.benchmark.results import (
    BadResult,
    DatasetRecord,
    EpisodeResult,
    Machine,
    ResultRow,
    Validation,
    read_certificate,
    read_evaluation,
)
from lerobot_bimanual.commands.compare import CompareConfig, compare
from lerobot_bimanual.commands.leaderboard import LeaderboardConfig, leaderboard
from lerobot_bimanual.errors import BimanualError


def episodes(outcomes: str, first_seed: int = 0) -> tuple[EpisodeResult, ...]:
    """One episode per letter, `x` solved and `.` not."""
    return tuple(EpisodeResult(first_seed + index, letter == "x") for index, letter in enumerate(outcomes))


ROW = ResultRow(
    schema_version=2,
    world="0123456789ab",
    task="lift_ball",
    variation="any",
    policy="mine",
    recipe="small",
    flags={
        "dataset.repo_id": "benchmark/lift_ball",
        "policy.type": "mine",
        "policy.depth": "3",
        "policy.shift": "[0.5, 0]",
        "policy.head": "null",
        "policy.name": "plain",
        "steps": "4",
        "batch_size": "2",
        "save_freq": "2",
        "log_freq": "1",
        "seed": "1000",
    },
    dataset=DatasetRecord("lerobot-bimanual generate --image_size=128x128", 128, (0, 1), {"mujoco": "3"}),
    checkpoint_step=4,
    checkpoint_sha256="0f" * 32,
    validation=(Validation(2, episodes("..")), Validation(4, episodes(".x"))),
    split="test",
    episodes=episodes("xx.."),
    expert=episodes("xxxx"),
    blind=(EpisodeResult(0, False, 0, "no move left"),),
    training_seconds=1.5,
    machine=Machine(2, None),
    versions={"mujoco": "3"},
    date="2026-01-31",
)


def test_a_row_survives_json():
    text = ROW.to_json()
    assert ResultRow.from_json(text) == ROW
    assert ResultRow.from_json(text).to_json() == text


def test_where_one_checkpoint_left_nothing_to_choose_the_last_one_was_tested():
    row = replace(ROW, validation=())
    assert ResultRow.from_json(row.to_json()) == row
    with pytest.raises(
        ValueError, match="'checkpoint_step' is 2, but must be among the validated steps, or the last"
    ):
        replace(row, checkpoint_step=2)


def test_the_file_shows_success_rates_to_readers():
    rates = json.loads(ROW.to_json())["rates"]
    assert (rates["policy"]["successes"], rates["policy"]["trials"]) == (2, 4)
    assert rates["policy"]["wilson_95"] == pytest.approx([0.150, 0.850], abs=1e-3)


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (["schema_version"], 1, "schema_version"),
        (["task"], 3, r"result\.task is 3, but must be a str"),
        (["variation"], 0, r"result\.variation"),
        (["policy"], None, r"result\.policy"),
        (["recipe"], [], r"result\.recipe"),
        (["flags"], {"steps": 4}, r"result\.flags\.steps"),
        (["flags"], {"steps": "4"}, "'flags'.*must hold the numbers steps, batch_size, save_freq, seed"),
        (["dataset"], "here", r"result\.dataset"),
        (["dataset", "command"], 1, r"result\.dataset\.command"),
        (["dataset", "seeds"], [0, 1.5], r"result\.dataset\.seeds\[1\]"),
        (["dataset", "versions"], [], r"result\.dataset\.versions"),
        (["checkpoint_step"], 3, r"'checkpoint_step' is 3, but must be among the validated steps"),
        (["checkpoint_sha256"], "abc", "'checkpoint_sha256' is 'abc', but must be 64 hex digits"),
        (["validation"], {}, r"result\.validation"),
        (["validation", 0, "step"], True, r"result\.validation\[0\]\.step"),
        (["split"], "holdout", "'split' is 'holdout', but must be one of: train, val, test"),
        (["episodes"], [], "'episodes'.*must not be empty"),
        (["episodes", 1, "seed"], 0, "'episodes'.*nor repeat a seed"),
        (["episodes", 1, "success"], 1, r"result\.episodes\[1\]\.success is 1, but must be a bool"),
        (["expert", 0, "failure"], 5, r"result\.expert\[0\]\.failure"),
        (["blind", 0, "variation"], "0", r"result\.blind\[0\]\.variation"),
        (["blind", 0, "state_hash"], 0, r"result\.blind\[0\]\.state_hash"),
        (["training_seconds"], -1.0, "training_seconds"),
        (["machine", "cpus"], 1.5, r"result\.machine\.cpus"),
        (["machine", "gpu"], 1, r"result\.machine\.gpu"),
        (["versions", "mujoco"], 3, r"result\.versions\.mujoco"),
        (["date"], "yesterday", "'date' is 'yesterday', but must be a day"),
        (["rates", "policy", "successes"], 4, "'rates'.*but the episodes give"),
        (["remark"], "well done", "result has unknown remark"),
    ],
)
def test_a_bad_field_is_named(place: list[Any], value: Any, message: str):
    content = json.loads(ROW.to_json())
    inner = content
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    with pytest.raises(BadResult, match=message):
        ResultRow.from_json(json.dumps(content))


@pytest.mark.parametrize("name", [*ROW.__dataclass_fields__, "rates"])
def test_a_missing_field_is_named(name: str):
    content = json.loads(ROW.to_json())
    del content[name]
    with pytest.raises(BadResult, match=name):
        ResultRow.from_json(json.dumps(content))


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b"3", b"\xff", b"[" * 100_000])
def test_what_is_no_result_is_refused_with_the_file_it_is_in(tmp_path, text):
    path = tmp_path / "row.json"
    path.write_bytes(text)
    with pytest.raises(BadResult, match=r"row\.json: .*must be"):
        ResultRow.read(path)


def test_a_result_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(BadResult, match="No such file"):
        ResultRow.read(tmp_path / "row.json")


def evaluation(*successes: list[bool]) -> str:
    return json.dumps({"per_task": [{"metrics": {"successes": task}} for task in successes]})


def test_seeds_of_an_evaluation_count_up(tmp_path):
    path = tmp_path / "eval_info.json"
    path.write_text(evaluation([True, False]))
    assert read_evaluation(path, first_seed=7) == episodes("x.", first_seed=7)


def test_an_evaluation_of_several_tasks_is_refused(tmp_path):
    path = tmp_path / "eval_info.json"
    path.write_text(evaluation([True], [True]))
    with pytest.raises(BadResult, match="holds 2 tasks"):
        read_evaluation(path, first_seed=0)


def certificate(*tasks: str) -> str:
    played = [
        {
            "task": task,
            "variation": 1,
            "seed": seed,
            "success": bool(seed),
            "failure": "" if seed else "fell",
            "state_hash": f"{seed:02x}",
        }
        for seed, task in enumerate(tasks)
    ]
    return json.dumps({"episodes": played})


def test_a_certificate_gives_variation_failure_and_final_state(tmp_path):
    path = tmp_path / "expert.json"
    path.write_text(certificate("lift_ball", "lift_ball"))
    assert read_certificate(path) == (
        EpisodeResult(0, False, 1, "fell", "00"),
        EpisodeResult(1, True, 1, None, "01"),
    )


def test_a_certificate_of_several_tasks_is_refused(tmp_path):
    path = tmp_path / "expert.json"
    path.write_text(certificate("lift_ball", "push_box"))
    with pytest.raises(BadResult, match=r"\['lift_ball', 'push_box'\]"):
        read_certificate(path)


@pytest.mark.parametrize(
    "content", [b"", b"[]", b"{}", b"\xff", b"[" * 100_000, b'{"per_task": [1], "episodes": [1]}']
)
@pytest.mark.parametrize("read", [read_certificate, lambda path: read_evaluation(path, first_seed=0)])
def test_measurements_of_another_form_are_refused_by_name(read, content, tmp_path):
    path = tmp_path / "measured.json"
    path.write_bytes(content)
    with pytest.raises(BimanualError, match=r"measured\.json"):
        read(path)


@pytest.mark.parametrize(
    ("only_first", "only_second", "p_value"),
    [(0, 0, 1.0), (1, 9, 22 / 1024), (9, 1, 22 / 1024), (5, 5, 1.0), (6, 0, 2 / 64)],
)
def test_mcnemars_test_has_the_binomial_tail(only_first, only_second, p_value):
    assert Pairing(3, only_first, only_second, 4).p_value == pytest.approx(p_value)


def test_episodes_are_paired_by_seed():
    other = replace(ROW, episodes=tuple(reversed(episodes("x.x.x", first_seed=1))))
    # Seeds 1, 2 and 3 are shared: the first solved 1, the second 1 and 3.
    assert pair(ROW, other) == Pairing(both=1, only_first=0, only_second=1, neither=1)


@pytest.mark.parametrize(
    ("difference", "message"),
    [
        ({"task": "push_box"}, "differ in task: 'lift_ball' and 'push_box'"),
        ({"world": "ba9876543210"}, "world 0123456789ab for one result and ba9876543210 for the other"),
        ({"variation": "0"}, "differ in variation"),
        ({"split": "val"}, "differ in split"),
        ({"versions": {"mujoco": "4"}}, "mujoco was 3 for one result and 4 for the other"),
        ({"episodes": episodes("xx", first_seed=50)}, "share no seed"),
    ],
)
def test_only_the_same_episodes_are_compared(difference, message):
    with pytest.raises(BimanualError, match=message):
        pair(ROW, replace(ROW, **difference))


def test_compare_prints_both_rates_and_the_test(tmp_path: Path, capsys):
    (tmp_path / "one.json").write_text(ROW.to_json())
    (tmp_path / "two.json").write_text(replace(ROW, policy="act", episodes=episodes("...x")).to_json())
    compare(CompareConfig(first=tmp_path / "one.json", second=tmp_path / "two.json"))
    printed = capsys.readouterr().out
    assert "2 of 4" in printed
    assert "1 of 4" in printed
    assert "only the first 2, only the second 1, neither 1; McNemar's exact test: p = 1" in printed


@pytest.fixture
def results(tmp_path: Path, install_recipe) -> Path:
    """Three of the four results of two policies on two tasks."""
    folder = tmp_path / "results"
    folder.mkdir()
    for policy in ("mine", "other"):
        install_recipe(policy)
    for policy, task in (("mine", "lift_ball"), ("other", "lift_ball"), ("mine", "push_box")):
        flags = ROW.flags | {"dataset.repo_id": f"benchmark/{task}", "policy.type": policy}
        row = replace(ROW, policy=policy, task=task, flags=flags)
        (folder / f"{task}_{policy}.json").write_text(row.to_json())
    return folder


def test_a_leaderboard_has_a_line_per_task_and_a_column_per_policy(results: Path):
    lines = render(results).splitlines()
    first = lines.index("| task | `mine` | `other` | expert | blind |")
    score = "2/4 (15% to 85%)"
    assert lines[first + 2 : first + 4] == [
        f"| `lift_ball` | {score} | {score} | 4 | 0/1 (0% to 79%) |",
        f"| `push_box` | {score} | – | 4 | 0/1 (0% to 79%) |",
    ]
    beyond = "`--demos=2 --val_episodes=2 --test_episodes=4`"
    assert f"| `push_box` | `mine` | 2 | 4 of 4 | 0.0 | 2 cores | 2: 0/2, 4: 1/2 | {beyond} |" in lines


def test_a_leaderboard_says_how_a_row_departs_from_todays_recipe(results: Path):
    departing = {"steps": "6", "policy.depth": "3.0", "policy.shift": "[0.5,1]", "policy.more": "a b"}
    flags = ROW.flags | departing | {"policy.device": "cpu", "num_workers": "3", "wandb.enable": "false"}
    (results / "lift_ball_mine.json").write_text(replace(ROW, flags=flags, task="sweep").to_json())
    (results / "push_box_mine.json").unlink()
    flags["dataset.repo_id"] = "benchmark/sweep"
    (results / "lift_ball_mine.json").write_text(replace(ROW, flags=flags, task="sweep").to_json())
    beyond = """--steps=6 --val_episodes=2 --test_episodes=4 --train_flags="--policy.shift=[0.5,1] '--policy.more=a b'\""""
    command = f"lerobot-bimanual benchmark --policy=mine --task=sweep --recipe=small --demos=2 {beyond} --device=cpu"
    page = render(results)
    assert f"| `--demos=2 {beyond}` |" in page
    assert f"```bash\n{command}\n```" in page


def test_a_row_that_no_command_gives_again_is_refused(results: Path, install_recipe):
    flags = {name: value for name, value in ROW.flags.items() if name != "policy.depth"}
    (results / "lift_ball_mine.json").write_text(replace(ROW, flags=flags).to_json())
    with pytest.raises(BimanualError, match=r"recipe 'small' of 'mine' now sets policy\.depth, and the row"):
        render(results)
    (results / "lift_ball_mine.json").write_text(replace(ROW, policy="gone").to_json())
    with pytest.raises(BimanualError, match=r"policy is 'gone', but must be one of: .*mine"):
        render(results)


def test_a_leaderboard_is_printed_or_written(results: Path, capsys):
    leaderboard(LeaderboardConfig(results=results))
    page = capsys.readouterr().out
    leaderboard(LeaderboardConfig(results=results, output=results / "page.md"))
    assert (results / "page.md").read_text() == page
    assert not capsys.readouterr().out


def test_a_leaderboard_of_nothing_or_of_unlike_results_is_refused(results: Path, tmp_path: Path):
    with pytest.raises(BimanualError, match=r"holds results of no recipe\(s\)"):
        render(tmp_path)
    (results / "again.json").write_text(ROW.to_json())
    with pytest.raises(BimanualError, match="two results of the same task"):
        render(results)
    (results / "again.json").write_text(replace(ROW, recipe="paper").to_json())
    with pytest.raises(BimanualError, match="paper, small"):
        render(results)
