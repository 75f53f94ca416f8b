"""The committed robustness results and reports: their pages are theirs, and they are of present policies and worlds."""

import json
from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.reports.robustness_pages import expert_robustness_page, robustness_page
from lerobot_bimanual.results.expert_report import ExpertReport
from lerobot_bimanual.results.robustness import RobustnessResult, perturb_text, read_expert_robustness
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.sweep.conditions import conditions_of

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
MAIN = {path.stem: RobustnessResult.read(path) for path in sorted((RESULTS / "robustness").glob("*.json"))}
POLICIES = MAIN | {
    path.stem: RobustnessResult.read(path) for path in sorted((RESULTS / "robustness").glob("*/*.json"))
}
PERTURBED = RESULTS / "expert_reports" / "perturbed"
EXPERTS = read_expert_robustness(PERTURBED) if PERTURBED.is_dir() else {}


@pytest.mark.parametrize(
    ("name", "results", "page_of", "command"),
    [
        ("robustness_results.md", MAIN, robustness_page, "results report --results=results/robustness"),
        ("expert_robustness.md", EXPERTS, expert_robustness_page, "expert report --output=docs/tasks.md"),
    ],
)
def test_a_page_of_robustness_is_that_of_the_files_or_says_how_it_is_made(name, results, page_of, command):
    page = (ROOT / "docs" / name).read_text()
    if results:
        assert page == page_of(results)
    else:
        assert command in page
        assert "|" not in page


def world_of_experts(task: str) -> str:
    return ExpertReport.read(RESULTS / "expert_reports/standard/expert.json").worlds[task]


def test_a_result_is_of_a_checkpoint_with_a_benchmark_result_on_other_episodes():
    rows = [json.loads(path.read_text()) for path in RESULTS.glob("*/*_small_seed*.json")]
    for name, result in POLICIES.items():
        of_weights = [row for row in rows if row["checkpoint_sha256"] == result.config.checkpoint_sha256]
        assert result.task in [row.get("task") or row["config"]["task"] for row in of_weights], name
        seeds = {episode["seed"] for row in of_weights for episode in row["episodes"]}
        assert not seeds & {*result.nominal.seeds}, name


def test_a_result_has_every_level_of_its_axes_and_one_of_a_committed_policy_all_axes():
    for name, result in POLICIES.items():
        committed = (ROOT / result.checkpoint).is_dir() and not Path(result.checkpoint).is_absolute()
        axes = () if committed else [axis.name for axis in result.axes]
        assert [each.key for each in result.conditions] == [*conditions_of(result.task, axes)], name
        assert result.nominal.world == world_of_experts(result.task), name


def test_a_report_of_the_expert_has_every_condition_that_changes_what_happens():
    for task, report in EXPERTS.items():
        conditions = conditions_of(task)
        played = [key for key in conditions if conditions.played_as(key) == key]
        assert [each.key for each in report.conditions] == played
        assert report.nominal.world == world_of_experts(task)


@pytest.mark.slow
@pytest.mark.sim
def test_a_condition_drawn_at_random_of_each_file_is_of_the_present_world():
    """Others in every run."""
    for result in (*POLICIES.values(), *EXPERTS.values()):
        condition = result.conditions[np.random.default_rng().integers(len(result.conditions))]
        assert condition.world == world_version(result.task, perturb_text(*condition.key)), condition.name
