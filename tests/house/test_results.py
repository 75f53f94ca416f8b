"""What is committed of results: the page is that of the rows, and every trained policy belongs to a row."""

import json
import re
import shlex
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lerobot_bimanual.benchmark.config import BenchmarkConfig, command, resolve, shortest_config
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.cli.flags import parse_flags
from lerobot_bimanual.files import sha256
from lerobot_bimanual.reports.benchmark_page import benchmark_page, read_results
from lerobot_bimanual.reports.success_figure import success_figure
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_env_bimanual.commands.results_verify import ResultsVerifyConfig, results_verify
from lerobot_env_bimanual.tasks.registry import resolve_tasks

ROOT = Path(__file__).parents[2]
BOARD, *TRIALS = (
    {path.name: BenchmarkResult.read(path) for path in sorted((ROOT / "results" / name).glob("*.json"))}
    for name in (
        "leaderboard",
        "made_again",
        "fresh_seeds",
        "without_quadratic_features",
        *("perturbed_demonstrations", "few_demonstrations", "without_keypose_step", "other_lengths"),
    )
)
"""Results by name. Trials are cells that were made again (docs/benchmark.md), policies of the board on fresh episodes, without
quadratic features, that learned in perturbed worlds, from fewer demonstrations, without the count of
keyposes or in another number of steps (docs/learning.md)."""
AGAIN, FRESH, WITHOUT_FEATURES, *_ = TRIALS
ALL_ROWS = [row for folder in (BOARD, *TRIALS) for row in folder.items()]
ROWS_PLAYED = 20
"""So that the test takes no longer the more rows there are."""
CHECKPOINTS = sorted(path for path in (ROOT / "results" / "checkpoints").iterdir() if path.is_dir())


@pytest.mark.slow
def test_the_page_of_results_and_its_figure_are_those_of_the_rows(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    folder = Path("results/leaderboard")
    page = benchmark_page(read_results(folder), folder, figure="results.png")
    assert (ROOT / "docs" / "results.md").read_text() == page
    assert described("results.png") == success_figure([*BOARD.values()]).description


def test_the_picture_of_failures_shows_every_failed_one_of_peract2():
    failed = Counter()
    for row in BOARD.values():
        if row.config.policy_id == "peract2":
            failed[row.task] += sum(not episode.success for episode in row.episodes)
    sentences = dict(re.findall(r"(\w+)(?: \w+)?: (\d+) failed", described("failure_attribution.png")))
    assert {task: int(count) for task, count in sentences.items()} == failed


def described(picture: str) -> str:
    """What a picture says of itself; its pixels depend on the version of the font."""
    with Image.open(ROOT / "docs" / picture) as image:
        return image.info["Description"]


def test_cells_that_were_made_again_are_the_first_ones_to_the_last_bit():
    assert AGAIN
    for name, row in AGAIN.items():
        first = [rows[name] for rows in (BOARD, WITHOUT_FEATURES) if name in rows]
        assert (row.checkpoint_sha256, row.episodes) in [
            (each.checkpoint_sha256, each.episodes) for each in first
        ]


def test_fresh_seeds_were_played_with_the_weights_of_the_board():
    assert FRESH
    for name, row in FRESH.items():
        assert row.checkpoint_sha256 == BOARD[name].checkpoint_sha256
        assert not {each.seed for each in row.episodes} & {each.seed for each in BOARD[name].episodes}


def test_every_row_is_of_the_world_of_the_experts():
    worlds = json.loads((ROOT / "results/expert_reports/expert.json").read_text())["worlds"]
    assert {(row.task, row.world) for _, row in ALL_ROWS} <= worlds.items()


@pytest.mark.parametrize(("name", "result"), ALL_ROWS, ids=[name for name, _ in ALL_ROWS])
def test_the_command_that_is_printed_for_a_result_trains_and_scores_exactly_that_result(name, result):
    assert name == result.config.file_name
    program, group, verb, *flags = shlex.split(command(shortest_config(result.config)))
    assert (program, group, verb) == ("lerobot-bimanual", "policy", "benchmark")
    config = parse_flags(BenchmarkConfig, flags)
    assert resolve(config) == result.config
    generated = dict(word.removeprefix("--").split("=", 1) for word in Plan.of(config).generation().words[3:])
    recorded = result.demonstrations.settings
    assert (recorded["views"], recorded["cameras"]) == ([generated["view"]], generated["cameras"].split(","))
    assert str(recorded["episodes"]) == generated["episodes"]
    assert str(recorded["height"]) == str(recorded["width"]) == generated["image_size"]
    assert recorded["depth"] == (generated.get("depth") != "false")
    assert (recorded["perturb"], recorded["split"]) == (generated.get("perturb", ""), "train")
    assert len(result.demonstrations.seeds) == result.config.demos


@pytest.mark.parametrize("folder", CHECKPOINTS, ids=lambda path: path.name)
def test_a_trained_policy_is_small_and_that_of_the_rows_of_all_its_tasks(folder: Path):
    weights = folder / "model.safetensors"
    assert weights.stat().st_size <= 12_000_000
    rows = [row for row in BOARD.values() if row.checkpoint_sha256 == sha256(weights)]
    assert {row.config.policy_id for row in rows} == {folder.name}
    assert {row.task for row in rows} == set(resolve_tasks(rows[0].config.trained_on))
    for row in rows:
        assert row.rates["policy"].interval[0] > row.rates["open_loop"].interval[1]


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.timeout(1800)
def test_what_rows_claim_is_what_happens_when_they_are_played_again(tmp_path: Path, capsys):
    """Other rows and episodes in every run; `lerobot-bimanual results verify --results=results/leaderboard` plays all."""
    seed = int(np.random.default_rng().integers(1000))
    paths = sorted(path for path in ROOT.glob("results/*/*_seed*.json") if path.parent.name != "robustness")
    rooms = set()
    for index in np.random.default_rng(seed).permutation(len(paths))[:ROWS_PLAYED]:
        room = tmp_path / paths[index].parent.name
        room.mkdir(exist_ok=True)
        (room / paths[index].name).symlink_to(paths[index])
        rooms.add(room)
    for room in sorted(rooms):
        config = ResultsVerifyConfig(results=room, sample=1, sample_seed=seed)
        assert results_verify(config) == 0, f"--sample_seed={seed}: {capsys.readouterr().out}"
