"""Results of benchmarks side by side: what does not belong together is refused, and then nothing is written."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from huggingface_hub import parse_eval_result_entries
from made_up_rows import ROW, episodes, generation, played, put, recorded, row_of

from lerobot_bimanual.benchmark.episode_result import Validation
from lerobot_bimanual.benchmark.leaderboard import render
from lerobot_bimanual.benchmark.reproduction import config_of
from lerobot_bimanual.benchmark.results import BadResult, ResultRow
from lerobot_bimanual.commands.results_leaderboard import ResultsLeaderboardConfig, results_leaderboard
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.versions import SIMULATION_PACKAGES


@pytest.fixture
def results(tmp_path: Path, install_recipe) -> Path:
    """Three of the four results of two policies on two tasks."""
    folder = tmp_path / "results"
    folder.mkdir()
    for policy in ("mine", "other"):
        install_recipe(policy)
    for policy, task in (("mine", "lift_ball"), ("other", "lift_ball"), ("mine", "push_box")):
        put(folder, row_of(policy, task))
    return folder


def test_a_leaderboard_has_a_line_per_task_and_a_column_per_policy(results: Path):
    lines = render(results).splitlines()
    first = lines.index("| task | `mine` | `other` | expert | blind |")
    score, blind = "2/4 (15% to 85%)", "1/4 (5% to 70%)"
    assert lines[first + 2 : first + 5] == [
        f"| `lift_ball` | {score} | {score} | 4 | {blind} |",
        f"| `push_box` | {score} | – | 4 | {blind} |",
        "| mean of 2 | 50.0% | – | 100.0% | 25.0% |",
    ]
    beyond = "`--demos=2 --val_episodes=2 --test_episodes=4`"
    assert f"| `push_box` | `mine` | 2 | 4 of 4 | 0.0 | 2 cores | 2: 0/2, 4: 1/2 | {beyond} |" in lines


def test_a_network_for_several_tasks_has_a_column_of_its_own_and_a_command_that_says_so(results: Path):
    row = row_of("mine", "lift_ball")
    dataset = replace(row.dataset, command=generation("lift_ball,push_box"))
    flags = row.flags | {"dataset.repo_id": "benchmark/lift_ball.push_box"}
    path = put(results, replace(row, dataset=dataset, flags=flags, validation=()))

    page = render(results)

    assert path.name == "lift_ball_mine_small_seed1000_on_lift_ball.push_box.json"
    assert "| task | `mine` | `mine_on_lift_ball.push_box` | `other` | expert | blind |" in page
    beyond = "--trained_on=lift_ball,push_box --demos=2 --test_episodes=4"
    line = f"| `lift_ball` | `mine_on_lift_ball.push_box` | 2 | 4 of 4 | 0.0 | 2 cores |  | `{beyond}` |"
    assert line in page


def test_what_was_perturbed_has_a_line_or_a_column_of_its_own_and_a_command_that_says_so(
    results: Path, tmp_path: Path
):
    row = row_of("mine", "lift_ball")
    folder = tmp_path / "certificates"
    folder.mkdir()
    worlds = {"lift_ball": ROW.world, "push_box": ROW.world}
    (folder / "expert.json").write_text(json.dumps({"worlds": worlds}))
    tested = put(
        results, replace(row, world="ba9876543210", options=ROW.options | {"perturb": "light:2,mass:1"})
    )
    put(results, another_demonstration(row, " --perturb=mass:1"))

    page = render(results, folder)

    assert tested.name == "lift_ball_light2,mass1_mine_small_seed1000.json"
    assert "| task | `mine` | `mine_mass1` | `other` | expert | blind |" in page
    score = "2/4 (15% to 85%)"
    assert f"| `lift_ball` | {score} | {score} | {score} | 4 |" in page
    assert f"| `lift_ball_light2,mass1` | {score} | – | – | 4 |" in page
    beyond = "--demos=2 --val_episodes=2 --test_episodes=4"
    assert f"`{beyond} --perturb=light:2,mass:1` |" in page
    assert f"`{beyond} --demos_perturb=mass:1` |" in page


def another_demonstration(row: ResultRow, flag: str) -> ResultRow:
    return replace(row, dataset=replace(row.dataset, command=row.dataset.command + flag))


def test_a_leaderboard_says_how_a_row_departs_from_todays_recipe(results: Path):
    departing = {"steps": "6", "policy.depth": "3.0", "policy.shift": "[0.5,1]", "policy.more": "a b"}
    row = row_of("mine", "sweep")
    flags = row.flags | departing | {"policy.device": "cpu", "num_workers": "3", "wandb.enable": "false"}
    validation = (*ROW.validation, Validation(6, episodes("x.")))
    put(results, replace(row, flags=flags, validation=validation, checkpoint_step=6))
    beyond = """--steps=6 --val_episodes=2 --test_episodes=4 --train_flags="--policy.shift=[0.5,1] '--policy.more=a b'\""""
    command = f"lerobot-bimanual policy benchmark --policy=mine --task=sweep --recipe=small --demos=2 {beyond} --device=cpu"
    page = render(results)
    assert f"| `--demos=2 {beyond}` |" in page
    assert f"```bash\n{command}\n```" in page


def test_a_row_that_no_command_gives_again_is_refused_with_its_file(results: Path, install_recipe):
    row = row_of("mine", "lift_ball")
    flags = {name: value for name, value in row.flags.items() if name != "policy.depth"}
    path = put(results, replace(row, flags=flags))
    message = rf"{path.name}: the recipe 'small' of 'mine' now sets policy\.depth, and the row"
    with pytest.raises(BimanualError, match=message):
        render(results)
    put(results, replace(row, flags=row.flags | {"config_path": "somewhere"}))
    with pytest.raises(BimanualError, match=rf"{path.name}: --train_flags sets --config_path"):
        render(results)
    put(results, row)


def test_rows_of_policies_that_are_not_installed_stand_in_the_table_too(results: Path):
    put(results, row_of("theirs", "lift_ball"))
    page = render(results)
    assert "| task | `mine` | `other` | `theirs` | expert | blind |" in page
    assert (
        "| `lift_ball` | `theirs` | 2 | 4 of 4 | 0.0 | 2 cores | 2: 0/2, 4: 1/2 | its recipe is not installed"
        in page
    )
    assert "benchmark --policy=mine --task=push_box" in page


def test_rows_take_the_hubs_form_and_come_back_from_it(results: Path, tmp_path: Path):
    config = ResultsLeaderboardConfig(
        results=results, hub_results=tmp_path / "hub", output=tmp_path / "page.md"
    )
    with pytest.raises(BimanualError, match="benchmark_repo is None, but --hub_results needs"):
        results_leaderboard(config)
    results_leaderboard(replace(config, benchmark_repo="me/bimanual"))
    files = sorted((tmp_path / "hub").glob("*.yaml"))
    assert [file.stem for file in files] == sorted(path.stem for path in results.glob("*.json"))
    (entry,) = parse_eval_result_entries(yaml.safe_load(files[0].read_text()))
    assert (entry.dataset_id, entry.task_id) == ("me/bimanual", "lift_ball")
    assert (entry.value, entry.date) == (50.0, "2026-01-31")
    assert "2 of 4 unseen episodes" in (entry.notes or "")


def test_a_leaderboard_is_printed_or_written(results: Path, capsys):
    results_leaderboard(ResultsLeaderboardConfig(results=results))
    page = capsys.readouterr().out
    results_leaderboard(ResultsLeaderboardConfig(results=results, output=results / "page.md"))
    assert (results / "page.md").read_text() == page
    assert not capsys.readouterr().out


def test_a_leaderboard_of_nothing_is_refused(tmp_path: Path):
    with pytest.raises(
        BimanualError, match="holds no results; `lerobot-bimanual policy benchmark` writes them"
    ):
        render(tmp_path)


EXPERT_FAILS_ONCE, WITH_OTHER_VERSIONS = played("xxx."), dict.fromkeys(SIMULATION_PACKAGES, "4")
UNLIKE = {
    "another recipe": ({"recipe": "paper"}, "recipe is 'small', but 'paper' in"),
    "another world": ({"world": "ba9876543210"}, "world of lift_ball is '0123456789ab', but 'ba9876543210'"),
    "another expert": ({"expert": EXPERT_FAILS_ONCE}, "expert on lift_ball is"),
    "another blind control": ({"blind": played("....")}, "blind on lift_ball is"),
    "blind on further variations": ({"blind": ROW.blind + played("....", 1)}, "blind on lift_ball is"),
    "other versions": (
        {
            "versions": WITH_OTHER_VERSIONS,
            "dataset": replace(ROW.dataset, versions=WITH_OTHER_VERSIONS),
        },
        "versions is",
    ),
}


@pytest.mark.parametrize(("changes", "message"), UNLIKE.values(), ids=UNLIKE.keys())
def test_a_leaderboard_of_unlike_results_is_refused_and_nothing_is_written(
    changes, message, results: Path, tmp_path: Path
):
    put(results, row_of("mine", "lift_ball", **changes))
    with pytest.raises(BimanualError, match=f"lift_ball_.*json: {message}.*keep what is alike"):
        results_leaderboard(ResultsLeaderboardConfig(results=results, output=tmp_path / "page.md"))
    assert not (tmp_path / "page.md").exists()


def another_training(results: Path, **changes) -> Path:
    row = row_of("mine", "lift_ball")
    flags = row.flags | {"seed": "7"} | changes.pop("flags", {})
    return put(results, replace(row, **{"flags": flags, "checkpoint_sha256": "1f" * 32} | changes))


def test_several_trainings_of_a_policy_share_a_cell(results: Path):
    another_training(results, episodes=recorded("xxxx"))
    assert "| `lift_ball` | 4/4, 2/4: 75.0% ± 35.4% | 2/4 (15% to 85%) | 4 |" in render(results)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"flags": {"log_freq": "9"}}, "flag log_freq of mine on lift_ball is '9', but '1' in"),
        ({"flags": {"more": "9"}}, "flags of mine on lift_ball is .*more.*, but"),
        (
            {"checkpoint_sha256": ROW.checkpoint_sha256},
            "it has the weights of .*seed1000.json, so it is no other",
        ),
        (
            {"dataset": replace(ROW.dataset, command=ROW.dataset.command.replace("=2", "=1"), seeds=(0,))},
            "demonstrations' flag episodes of mine on lift_ball is '1', but '2' in",
        ),
        (
            {"dataset": replace(ROW.dataset, command=f"{ROW.dataset.command} --depth=false")},
            "demonstrations' flags of mine on lift_ball is .*depth",
        ),
        (
            {"options": ROW.options | {"max_keyposes": "40"}},
            "test's options of mine on lift_ball is .*max_keyposes",
        ),
        ({"stopped_against": "0f" * 32}, "its test was stopped as soon as it differed"),
    ],
)
def test_trainings_that_cannot_share_a_cell_are_refused(changes, message, results: Path):
    another_training(results, **changes)
    with pytest.raises(BimanualError, match=f"lift_ball_mine_small_seed.*json: {message}"):
        render(results)


def test_a_row_under_another_name_is_refused(results: Path):
    (results / "lift_ball_mine_small_seed1000.json").rename(results / "better.json")
    with pytest.raises(
        BimanualError, match=r"better\.json: its row is that of a file named lift_ball_mine_small"
    ):
        render(results)


def test_rows_of_another_world_than_the_certificates_are_refused(results: Path, tmp_path: Path):
    folder = tmp_path / "certificates"
    with pytest.raises(BimanualError, match=r"expert\.json: .*No such file"):
        render(results, folder)
    page = render(results)
    folder.mkdir()
    worlds = {"lift_ball": ROW.world, "push_box": ROW.world}
    (folder / "expert.json").write_text(json.dumps({"worlds": worlds}))
    assert render(results) == render(results, folder) == page
    (folder / "expert.json").write_text(json.dumps({"worlds": worlds | {"push_box": "ffffffffffff"}}))
    with pytest.raises(
        BimanualError, match=r"push_box.*world of push_box is '0123456789ab', but 'ffffffffffff'"
    ):
        render(results)


def test_a_row_with_damage_in_it_is_named_and_nothing_is_written(results: Path, tmp_path: Path):
    path = results / "push_box_mine_small_seed1000.json"
    path.write_text(path.read_text()[:-100])
    with pytest.raises(BadResult, match=path.name):
        results_leaderboard(ResultsLeaderboardConfig(results=results, output=tmp_path / "page.md"))
    assert not (tmp_path / "page.md").exists()


@pytest.mark.parametrize(
    "value",
    [
        "{",
        "[1",
        "2026-13-45",
        "!!int x",
        "!!timestamp x",
        "? [a]: :",
        "it's",
        "&a [*a]",
        "*b",
        "@",
        "9" * 5000,
    ],
)
def test_a_flag_that_is_no_yaml_is_compared_as_it_stands(value: str, results: Path):
    row = row_of("mine", "push_box")
    put(results, replace(row, flags=row.flags | {"policy.name": value}))
    render(results)
    assert shlex.split(config_of(row).train_flags) == []
    damaged = ResultRow.read(results / row.file_name)
    assert shlex.split(config_of(damaged).train_flags) == [f"--policy.name={value}"]
