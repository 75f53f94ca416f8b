"""What is committed of ladders: their page is theirs, of policies that are here, in worlds that are as they were."""

import json
from pathlib import Path

import numpy as np
import pytest

from lerobot_bimanual.ladder.result import LadderResult
from lerobot_bimanual.reports.robustness_page import robustness_page
from lerobot_env_bimanual.experts.world_version import world_version
from lerobot_env_bimanual.ladder.rungs import perturb_text, rungs_of

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results"
LADDERS = {path.stem: LadderResult.read(path) for path in sorted((RESULTS / "ladders").rglob("*.json"))}
EACH = pytest.mark.parametrize("name", LADDERS)


def test_the_page_of_robustness_is_that_of_the_files():
    results = {path.stem: LADDERS[path.stem] for path in sorted((RESULTS / "ladders").glob("*.json"))}
    page = robustness_page(results, "robustness_results.png")
    assert (ROOT / "docs" / "robustness_results.md").read_text() == page


@EACH
def test_a_ladder_is_of_a_checkpoint_that_has_a_row(name: str):
    rows = [json.loads(path.read_text()) for path in RESULTS.glob("*/*_small_seed*.json")]
    of_weights = [row for row in rows if row["checkpoint_sha256"] == LADDERS[name].checkpoint_sha256]
    assert LADDERS[name].task in [row["task"] for row in of_weights]
    # None of its episodes has been seen when the row was scored.
    assert not {episode["seed"] for row in of_weights for episode in row["episodes"]} & {
        *LADDERS[name].level_0.seeds
    }


@EACH
def test_a_ladder_has_every_rung_of_its_axes_and_one_of_a_committed_policy_all_axes(name: str):
    ladder = LADDERS[name]
    committed = (ROOT / ladder.checkpoint).is_dir() and not Path(ladder.checkpoint).is_absolute()
    axes = () if committed else [axis.name for axis in ladder.axes]
    assert [(rung.axis, rung.level) for rung in ladder.rungs] == [*rungs_of(ladder.task, axes)]
    worlds = json.loads((RESULTS / "certificates" / "expert.json").read_text())["worlds"]
    assert ladder.level_0.world == worlds[ladder.task]


@pytest.mark.slow
@pytest.mark.sim
@EACH
def test_a_rung_drawn_at_random_is_of_the_world_as_it_is_now(name: str):
    seed = int(np.random.default_rng().integers(1000))
    rungs = LADDERS[name].rungs
    rung = rungs[np.random.default_rng(seed).integers(len(rungs))]
    text = perturb_text(rung.axis, rung.level)
    assert rung.world == world_version(LADDERS[name].task, text), f"{rung.name}, {seed}"
