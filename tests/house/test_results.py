"""What is committed of results: the page is that of the rows, and every trained policy belongs to a row."""

import json
import re
import shlex
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lerobot_bimanual.benchmark.plan import BenchmarkConfig, Plan
from lerobot_bimanual.benchmark.reproduction import (
    INCIDENTAL,
    command,
    config_of,
    flag_value,
    policy_defaults,
)
from lerobot_bimanual.benchmark.results import PLACES, ResultRow
from lerobot_bimanual.checksums import sha256
from lerobot_bimanual.cli.flags import parse_flags
from lerobot_bimanual.reports.benchmark_page import benchmark_page, read_rows
from lerobot_bimanual.reports.success_figure import success_figure
from lerobot_env_bimanual.commands.results_verify import ResultsVerifyConfig, results_verify
from lerobot_env_bimanual.tasks.registry import resolve_tasks

ROOT = Path(__file__).parents[2]
BOARD, *TRIALS = (
    ROOT / "results" / name
    for name in (
        "leaderboard",
        "perturbed_demonstrations",
        "few_demonstrations",
        "without_keypose_step",
        "without_squares",
        "fresh_seeds",
        "other_lengths",
        "made_again",
    )
)
"""Trials are policies that learned in perturbed worlds (docs/robustness.md), from fewer demonstrations, without the count of
keyposes, without squares or in another number of steps, policies of the board on fresh episodes (docs/learning.md), and
cells that were made again (docs/benchmark.md)."""
ROWS = sorted(BOARD.glob("*.json"))
ALL_ROWS = [*ROWS, *(path for folder in TRIALS for path in sorted(folder.glob("*.json")))]
ROWS_PLAYED = 20
"""So that the test takes no longer the more rows there are."""
CHECKPOINTS = sorted(path for path in (ROOT / "results" / "checkpoints").iterdir() if path.is_dir())


def test_the_page_of_results_and_its_figure_are_those_of_the_rows(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    folder = Path("results/leaderboard")
    page = benchmark_page(read_rows(folder), folder, figure="results.png")
    assert (ROOT / "docs" / "results.md").read_text() == page
    assert described("results.png") == success_figure([*map(ResultRow.read, ROWS)]).description


def test_the_picture_of_who_lost_episodes_shows_every_failed_one_of_peract2():
    failed = Counter()
    for row in map(ResultRow.read, ROWS):
        if row.learner != "peract2":
            continue
        failed[row.task] += sum(not episode.success for episode in row.episodes)
    sentences = dict(re.findall(r"(\w+): (\d+) failed", described("blame.png")))
    assert {task: int(count) for task, count in sentences.items()} == failed


def described(picture: str) -> str:
    """What a picture says of itself; its pixels depend on the version of the font."""
    with Image.open(ROOT / "docs" / picture) as image:
        return image.info["Description"]


def test_cells_that_were_made_again_are_the_first_ones_to_the_last_bit():
    again = sorted((ROOT / "results/made_again").glob("*.json"))
    assert again
    rooms = BOARD, ROOT / "results/without_squares"
    for path in again:
        first = [ResultRow.read(room / path.name) for room in rooms if (room / path.name).is_file()]
        row = ResultRow.read(path)
        assert (row.checkpoint_sha256, row.episodes) in [
            (each.checkpoint_sha256, each.episodes) for each in first
        ]


def test_fresh_seeds_were_played_with_the_weights_of_the_board():
    fresh = sorted((ROOT / "results/fresh_seeds").glob("*.json"))
    assert fresh
    for row, first in ((ResultRow.read(path), ResultRow.read(BOARD / path.name)) for path in fresh):
        assert row.checkpoint_sha256 == first.checkpoint_sha256
        assert not {each.seed for each in row.episodes} & {each.seed for each in first.episodes}


def test_every_row_is_of_the_world_that_is_certified():
    certificate = json.loads((ROOT / "results/certificates/expert.json").read_text())
    assert {(row.task, row.world) for row in map(ResultRow.read, ALL_ROWS)} <= certificate["worlds"].items()


@pytest.mark.parametrize("path", ALL_ROWS, ids=lambda path: path.stem)
def test_the_command_that_is_printed_for_a_row_trains_and_scores_exactly_that_row(path: Path):
    row = ResultRow.read(path)
    program, group, leaf, *flags = shlex.split(command(config_of(row)))
    assert (program, group, leaf) == ("lerobot-bimanual", "policy", "benchmark")
    plan = Plan.of(parse_flags(BenchmarkConfig, flags))
    trained, planned = (
        {name: flag_value(value) for name, value in flags.items() if name not in (*PLACES, *INCIDENTAL)}
        for flags in (row.flags, plan.training_flags())
    )
    unsaid = {name: flag_value(policy_defaults(row.policy)[name]) for name in planned.keys() - trained.keys()}
    assert planned == unsaid | trained
    recorded, generated = (
        dict(word.removeprefix("--").split("=", 1) for word in words if word.startswith("--"))
        for words in (shlex.split(row.dataset.command), plan.generation().words)
    )
    for name in ("task", "variation", "split", "view", "cameras", "intermediate", "episodes"):
        assert generated.get(name) == recorded.get(name)
    assert recorded["image_size"] == "x".join([generated["image_size"]] * 2)
    episodes = plan.protocol.val_episodes  # none for one network of several tasks
    validated = plan.checkpoint_steps if episodes else ()
    assert [(each.step, len(each.episodes)) for each in row.validation] == [
        (step, episodes) for step in validated
    ]
    assert (row.split, len(row.episodes)) == ("test", plan.protocol.test_episodes)


@pytest.mark.parametrize("folder", CHECKPOINTS, ids=lambda path: path.name)
def test_a_trained_policy_is_small_and_that_of_the_rows_of_all_its_tasks(folder: Path):
    weights = folder / "model.safetensors"
    assert weights.stat().st_size <= 12_000_000
    rows = [row for row in map(ResultRow.read, ROWS) if row.checkpoint_sha256 == sha256(weights)]
    assert {row.learner for row in rows} == {folder.name}
    assert {row.task for row in rows} == set(resolve_tasks(rows[0].trained_on))
    for row in rows:
        assert row.rates["policy"].interval[0] > row.rates["blind"].interval[1]


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.timeout(1800)
def test_what_rows_claim_is_what_happens_when_they_are_played_again(tmp_path: Path, capsys):
    """Other rows and episodes in every run; `lerobot-bimanual results verify --results=results/leaderboard` plays all."""
    seed = int(np.random.default_rng().integers(1000))
    (tmp_path / "certificates").symlink_to(ROOT / "results" / "certificates")
    rooms = set()
    for index in np.random.default_rng(seed).permutation(len(ALL_ROWS))[:ROWS_PLAYED]:
        row = ALL_ROWS[index]
        room = tmp_path / row.parent.name
        room.mkdir(exist_ok=True)
        (room / row.name).symlink_to(row)
        rooms.add(room)
    for room in sorted(rooms):
        config = ResultsVerifyConfig(results=room, sample=1, controls=1, seed=seed)
        assert results_verify(config) == 0, f"--seed={seed}: {capsys.readouterr().out}"


@pytest.mark.sim
def test_a_row_whose_network_learned_another_task_is_not_as_claimed(tmp_path: Path, capsys):
    path = ROOT / "results/leaderboard/lift_ball_peract2_small_seed1000.json"
    row = json.loads(path.read_text())
    row["dataset"]["command"] = row["dataset"]["command"].replace("lift_ball", "push_box")
    row["flags"] = {name: value.replace("lift_ball", "push_box") for name, value in row["flags"].items()}
    changed = tmp_path / path.name.replace("peract2", "peract2_on_push_box")
    changed.write_text(json.dumps(row))
    assert results_verify(ResultsVerifyConfig(results=changed, sample=1, controls=0, workers=1)) == 1
    assert "it was trained on push_box, of which lift_ball is none" in capsys.readouterr().out
