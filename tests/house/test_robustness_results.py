"""The committed robustness results and reports: their pages are theirs, and they are of present policies and worlds."""

import json
from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.reports.robustness_pages import expert_robustness_page, robustness_page
from lerobot_bimanual.results.robustness import RobustnessResult, perturb_text, read_expert_robustness
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.sweep.conditions import conditions_of

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
POLICIES = {
    path.stem: RobustnessResult.read(path) for path in sorted((RESULTS / "robustness").rglob("*.json"))
}
EXPERTS = read_expert_robustness(RESULTS / "expert_reports" / "perturbed")
WORLDS = json.loads((RESULTS / "expert_reports" / "expert.json").read_text())["worlds"]


def test_the_pages_of_robustness_are_those_of_the_files():
    main = {path.stem: POLICIES[path.stem] for path in sorted((RESULTS / "robustness").glob("*.json"))}
    page = robustness_page(main)
    assert (ROOT / "docs" / "robustness_results.md").read_text() == page
    assert (ROOT / "docs" / "expert_robustness.md").read_text() == expert_robustness_page(EXPERTS)


@pytest.mark.parametrize("name", POLICIES)
def test_a_result_is_of_a_checkpoint_with_a_benchmark_result_on_other_episodes(name: str):
    result = POLICIES[name]
    rows = [json.loads(path.read_text()) for path in RESULTS.glob("*/*_small_seed*.json")]
    of_weights = [row for row in rows if row["checkpoint_sha256"] == result.config.checkpoint_sha256]
    assert result.task in [row.get("task") or row["config"]["task"] for row in of_weights]
    seeds = {episode["seed"] for row in of_weights for episode in row["episodes"]}
    assert not seeds & {*result.nominal.seeds}


@pytest.mark.parametrize("name", POLICIES)
def test_a_result_has_every_level_of_its_axes_and_one_of_a_committed_policy_all_axes(name: str):
    result = POLICIES[name]
    committed = (ROOT / result.checkpoint).is_dir() and not Path(result.checkpoint).is_absolute()
    axes = () if committed else [axis.name for axis in result.axes]
    assert [each.key for each in result.conditions] == [*conditions_of(result.task, axes)]
    assert result.nominal.world == WORLDS[result.task]


@pytest.mark.parametrize("task", EXPERTS)
def test_a_report_of_the_expert_has_every_condition_that_changes_what_happens(task: str):
    conditions, report = conditions_of(task), EXPERTS[task]
    played = [key for key in conditions if conditions.played_as(key) == key]
    assert [each.key for each in report.conditions] == played
    assert report.nominal.world == WORLDS[task]


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("result", [*POLICIES.values(), *EXPERTS.values()], ids=[*POLICIES, *EXPERTS])
def test_a_condition_drawn_at_random_is_of_the_present_world(result):
    """Another one in every run."""
    condition = result.conditions[np.random.default_rng().integers(len(result.conditions))]
    assert condition.world == world_version(result.task, perturb_text(*condition.key)), condition.name
