"""What is committed of certificates of rungs: their page is theirs, and they are of this world."""

import json
from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.ladder.rung_certificate import read_rung_certificates
from lerobot_bimanual.reports.expert_robustness_page import expert_robustness_page
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.ladder.rungs import perturb_text, rungs_of

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
RUNGS = RESULTS / "certificates" / "rungs"
CERTIFICATES = read_rung_certificates(RUNGS)


def test_the_page_of_expert_robustness_is_that_of_the_files():
    page = expert_robustness_page(CERTIFICATES)
    assert (ROOT / "docs" / "expert_robustness.md").read_text() == page


@pytest.mark.parametrize("task", CERTIFICATES)
def test_a_certificate_has_every_rung_that_changes_what_happens(task: str):
    rungs, certificate = rungs_of(task), CERTIFICATES[task]
    played = [key for key in rungs if rungs.played_as(*key) == key]
    assert [(rung.axis, rung.level) for rung in certificate.rungs] == played
    worlds = json.loads((RESULTS / "certificates" / "expert.json").read_text())["worlds"]
    assert certificate.rungs[0].world == worlds[task]


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("task", CERTIFICATES)
def test_a_rung_drawn_at_random_is_of_the_world_as_it_is_now(task: str):
    """Another one in every run; `lerobot-bimanual expert evaluate-perturbed` looks at all."""
    seed = int(np.random.default_rng().integers(1000))
    rungs = CERTIFICATES[task].rungs
    rung = rungs[np.random.default_rng(seed).integers(len(rungs))]
    assert rung.world == world_version(task, perturb_text(rung.axis, rung.level)), f"{rung.name}, {seed}"
