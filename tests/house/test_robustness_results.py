"""The committed robustness reports of the experts: their page is theirs, and they are of present worlds."""

from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.reports.robustness import expert_robustness_page
from lerobot_bimanual.results.expert_report import ExpertReport
from lerobot_bimanual.results.robustness import perturb_text, read_expert_robustness
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.sweep.conditions import conditions_of

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
PERTURBED = RESULTS / "expert_reports" / "perturbed"
EXPERTS = read_expert_robustness(PERTURBED) if PERTURBED.is_dir() else {}


def test_the_page_of_the_experts_is_that_of_their_reports():
    assert (ROOT / "docs/expert_robustness.md").read_text() == expert_robustness_page(EXPERTS)


def world_of_experts(task: str) -> str:
    return ExpertReport.read(RESULTS / "expert_reports/standard/expert.json").worlds[task]


def test_a_report_of_the_expert_has_every_condition_that_changes_what_happens():
    for task, report in EXPERTS.items():
        conditions = conditions_of(task)
        played = [key for key in conditions if conditions.played_as(key) == key]
        assert [each.key for each in report.conditions] == played
        assert report.nominal.world == world_of_experts(task)


@pytest.mark.slow
def test_a_condition_drawn_at_random_of_each_file_is_of_the_present_world():
    """Others in every run."""
    for result in EXPERTS.values():
        condition = result.conditions[np.random.default_rng().integers(len(result.conditions))]
        assert condition.world == world_version(result.task, perturb_text(*condition.key)), condition.name
