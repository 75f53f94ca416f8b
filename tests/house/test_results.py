"""Committed results: pages match rows and reports, which are of the present worlds; every trained policy belongs to a row."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.benchmark.config import BenchmarkConfig, command, resolve, shortest_config
from lerobot_bimanual.benchmark.plan import Plan
from lerobot_bimanual.benchmark.recipes import GROUP
from lerobot_bimanual.cli.flags import parse_flags
from lerobot_bimanual.distributions import entries
from lerobot_bimanual.files import sha256
from lerobot_bimanual.reports.benchmark_page import benchmark_page, read_results
from lerobot_bimanual.reports.robustness import expert_robustness_page
from lerobot_bimanual.results.benchmark import BenchmarkResult
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_bimanual.results.expert_report import ExpertReport
from lerobot_bimanual.results.protocols import TASKS
from lerobot_bimanual.results.robustness import RobustnessResult, perturb_text, read_expert_robustness
from lerobot_env_bimanual.commands.results_verify import ResultsVerifyConfig, results_verify
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.sweep.conditions import conditions_of
from lerobot_env_bimanual.tasks.registry import list_tasks, resolve_tasks

ROOT = Path(__file__).parents[2]
PATHS = sorted(ROOT.glob("results/**/*_seed*.json"))
ROWS = {path: BenchmarkResult.read(path) for path in PATHS}
SWEEPS = {path: RobustnessResult.read(path) for path in ROOT.glob("results/**/robustness/*.json")}
BOARD = {path: row for path, row in ROWS.items() if path.parent.name == "leaderboard"}
RECORDS = {path: EvaluationRecord.read(path) for path in ROOT.glob("results/**/*_record.json")}
ROWS_PLAYED = 20
"""So that the test takes no longer the more rows there are."""
REPORTS = ROOT.glob("results/expert_reports/*/expert.json")
WORLDS = {path.parent.name: ExpertReport.read(path).worlds for path in REPORTS}
"""Of the experts, by setting and task."""
CHECKPOINTS = sorted(path for path in (ROOT / "results" / "checkpoints").iterdir() if path.is_dir())


@pytest.mark.slow
def test_the_page_of_results_is_that_of_the_rows(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    page, folder = Path("docs/results.md"), Path("results/leaderboard")
    assert page.read_text() == benchmark_page(read_results(folder), folder)


def test_the_leaderboard_has_rows_of_benchmarks_only_and_its_protocols_the_tasks_of_this_repository():
    assert {*BOARD} == {*(ROOT / "results/leaderboard").glob("*.json")}
    assert list_tasks() == TASKS


def test_every_row_record_and_sweep_is_of_the_world_of_the_experts():
    for path, row in ROWS.items():
        if not row.config.perturb:
            assert row.world == WORLDS[row.config.setting][row.task], path
    for path, record in RECORDS.items():
        if not record.options["perturb"]:
            assert record.world == WORLDS[record.options["setting"]][record.task], path
    for path, sweep in SWEEPS.items():
        assert sweep.nominal.world == WORLDS[sweep.config.options["setting"]][sweep.task], path


@pytest.mark.slow
def test_every_row_of_a_perturbed_test_is_of_the_present_world():
    for path, row in ROWS.items():
        if row.config.perturb:
            here = world_version(row.task, row.config.perturb, row.config.setting)
            assert row.world == here, path


SETTINGS = [resolve(BenchmarkConfig(policy, "push_box", seed=7)) for policy in sorted(entries(GROUP))]
SETTINGS += [row.config for row in ROWS.values() if row.config.policy in entries(GROUP)]
QUOTED = (
    "--policy.shift=[0.5,1] '--policy.more=a b' --policy.depth=3.0 --policy.head=null --policy.name=\"it's\""
)
SETTINGS += [
    resolve(BenchmarkConfig("act", "push_box", steps=6, save_freq=6, val_episodes=0, train_flags=QUOTED)),
    resolve(BenchmarkConfig("peract2", "push_box", variation="00", perturb="mass:1,light:2", device="cpu")),
    resolve(BenchmarkConfig("peract2", "push_box", protocol="multitask", save_freq=6)),
]


@pytest.mark.parametrize("settings", SETTINGS, ids=lambda each: each.file_name)
def test_the_command_that_is_printed_for_a_result_trains_and_scores_exactly_that_result(settings):
    program, group, verb, *flags = shlex.split(command(shortest_config(settings)))
    assert (program, group, verb) == ("lerobot-bimanual", "policy", "benchmark")
    assert resolve(parse_flags(BenchmarkConfig, flags)) == settings


def test_a_row_has_the_file_name_and_demonstrations_that_its_command_would_give():
    for path, row in ROWS.items():
        assert path.name == row.config.file_name
        if row.config.policy not in entries(GROUP):
            continue  # of another distribution
        words = Plan.of(shortest_config(row.config)).generation().words[3:]
        generated = dict(word.removeprefix("--").split("=", 1) for word in words)
        recorded = row.demonstrations.settings
        assert recorded["views"] == [generated["view"]]
        assert recorded["cameras"] == generated["cameras"].split(",")
        assert str(recorded["episodes"]) == generated["episodes"]
        assert str(recorded["height"]) == str(recorded["width"]) == generated["image_size"]
        assert recorded["depth"] == (generated.get("depth") != "false")
        assert recorded["split"] == "train"
        for name, usual in {"perturb": "", "setting": "standard", "plans": "one", "variation": "any"}.items():
            assert recorded.get(name, usual) == generated.get(name, usual), path
        assert str(recorded["first_seed"]) == generated.get("first_seed", "0")
        assert recorded["tasks"] == generated["task"].split(",") or row.config.trained_on
        seeds = row.demonstrations.seeds
        assert len(seeds) == row.config.demos
        assert len({*seeds}) == len(seeds) or row.config.demos_plans == "several"
        assert row.options["image_size"] == row.config.image_size
        assert row.checkpoint_step == row.config.steps or row.validation


@pytest.mark.parametrize("folder", CHECKPOINTS, ids=lambda path: path.name)
def test_a_trained_policy_is_small_and_has_a_row_above_the_baseline_for_each_of_its_tasks(folder: Path):
    weights = folder / "model.safetensors"
    assert weights.stat().st_size <= 12_000_000
    rows = [row for row in BOARD.values() if row.checkpoint_sha256 == sha256(weights)]
    assert {row.config.policy_id for row in rows} == {folder.name}
    for row in rows:
        assert {each.task for each in rows} == {*resolve_tasks(row.config.trained_on)}
        assert row.rates["policy"].interval[0] > row.rates["open_loop"].interval[1]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_replay_of_rows_gives_the_outcomes_that_they_claim(tmp_path: Path, capsys):
    """Draws rows and episodes; `lerobot-bimanual results verify --results=results/leaderboard` plays all."""
    seed = int(np.random.default_rng().integers(1000))
    rooms = set()
    for index in np.random.default_rng(seed).permutation(len(PATHS))[:ROWS_PLAYED]:
        room = tmp_path / PATHS[index].parent.name
        room.mkdir(exist_ok=True)
        (room / PATHS[index].name).symlink_to(PATHS[index])
        rooms.add(room)
    for room in sorted(rooms):
        config = ResultsVerifyConfig(results=room, sample=1, sample_seed=seed)
        assert results_verify(config) == 0, f"--sample_seed={seed}: {capsys.readouterr().out}"


PERTURBED = ROOT / "results/expert_reports/perturbed"
EXPERTS = read_expert_robustness(PERTURBED) if PERTURBED.is_dir() else {}


def test_the_page_of_the_experts_is_that_of_their_reports():
    assert (ROOT / "docs/expert_robustness.md").read_text() == expert_robustness_page(EXPERTS)


def test_a_report_of_the_expert_has_every_condition_that_changes_what_happens():
    for task, report in EXPERTS.items():
        conditions = conditions_of(task)
        played = [key for key in conditions if conditions.reference_condition(key) == key]
        assert [each.key for each in report.conditions] == played
        assert report.nominal.world == WORLDS["standard"][task]


@pytest.mark.slow
def test_a_random_condition_of_each_expert_report_has_the_current_world_version():
    """Every run draws other conditions."""
    for result in EXPERTS.values():
        condition = result.conditions[np.random.default_rng().integers(len(result.conditions))]
        assert condition.world == world_version(result.task, perturb_text(*condition.key)), condition.name
