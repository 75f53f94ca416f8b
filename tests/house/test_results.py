"""What is committed of results: the page is that of the rows, and every trained policy belongs to a row."""

import json
from pathlib import Path

import pytest

from lerobot_bimanual.benchmark.leaderboard import render
from lerobot_bimanual.benchmark.pipeline import sha256
from lerobot_bimanual.benchmark.recipe import FAR_TASKS, LONG_TASKS, SMALL_HORIZON, recipe_for
from lerobot_bimanual.benchmark.results import ResultRow
from lerobot_env_bimanual.registry import list_tasks

ROOT = Path(__file__).parents[2]
ROWS = sorted((ROOT / "results" / "small").glob("*.json"))
CERTIFICATE = ROOT / "results" / "certificates" / "expert.json"
CHECKPOINTS = sorted(path for path in (ROOT / "results" / "checkpoints").iterdir() if path.is_dir())


def test_the_page_of_results_is_that_of_the_rows(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    assert (ROOT / "docs" / "results.md").read_text() == render(Path("results/small"))


@pytest.mark.parametrize("path", ROWS, ids=lambda path: path.stem)
def test_a_row_was_trained_with_the_recipe_and_tested_on_fifty_unseen_episodes(path: Path):
    row = ResultRow.read(path)
    recipe = recipe_for(row.policy, "small", row.task)  # pyright: ignore[reportArgumentType]
    trained = {name.removeprefix("policy."): value for name, value in row.flags.items()}
    assert recipe.flags.items() <= trained.items()
    assert (row.split, len(row.episodes)) == ("test", recipe.test_episodes)
    assert len(row.dataset.seeds) == recipe.demos
    assert (trained["steps"], trained["batch_size"]) == (str(recipe.steps), str(recipe.batch_size))


def test_the_recipe_names_only_tasks_that_exist():
    assert {*FAR_TASKS, *LONG_TASKS} <= set(list_tasks())


def test_the_recipe_of_every_task_tells_all_its_keyposes_apart():
    episodes = json.loads(CERTIFICATE.read_text())["episodes"]
    longest = {
        task: max((len(episode["keyposes"]) for episode in episodes if episode["task"] == task), default=0)
        for task in list_tasks()
    }
    assert {task: count for task, count in longest.items() if count + 1 > SMALL_HORIZON} == LONG_TASKS
    for task, count in longest.items():
        assert int(recipe_for("peract2", "small", task).flags["keypose_horizon"]) > count


@pytest.mark.parametrize("folder", CHECKPOINTS, ids=lambda path: path.name)
def test_a_trained_policy_is_small_and_that_of_a_row(folder: Path):
    weights = folder / "model.safetensors"
    assert weights.stat().st_size <= 12_000_000
    (row,) = [row for row in map(ResultRow.read, ROWS) if row.checkpoint_sha256 == sha256(weights)]
    assert row.task == folder.name
    assert row.rates["policy"].interval[0] > row.rates["blind"].interval[1]
