"""Who lost an episode is found where it is known: one arm's half of one keypose was made wrong."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from planted_failures import SEED, evaluation, expert_keyposes, from_on, played, rereading_keyposes, shifted

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.results.evaluation import EvaluationRecord
from lerobot_env_bimanual.audit.blame import Blamer, Loser
from lerobot_env_bimanual.audit.failure_class import FailureClass
from lerobot_env_bimanual.commands.results_diagnose import ResultsDiagnoseConfig, results_diagnose

pytestmark = pytest.mark.sim

EASY, TRAY = "handover_item_easy", "lift_tray"
NUDGED_SEED = 40_004
LEFT_X, LEFT_OPEN, RIGHT_X, RIGHT_OPEN = 0, 7, 9, 16
OPTIONS = {"split": "test", "max_keyposes": 25}


def record_of(task: str, *episodes) -> EvaluationRecord:
    return evaluation(task, OPTIONS, *episodes)


def blamed(task: str, episode):
    blamer = Blamer(task, OPTIONS)
    found = blamer.blame(episode)
    blamer.close()
    return found


PLANTED = {
    "left grasp": (EASY, shifted(1, LEFT_X, 0.06), 1, Loser.LEFT),
    "left opens early": (EASY, from_on(3, LEFT_OPEN, 1.0), 3, Loser.LEFT),
    "right never closes": (EASY, from_on(4, RIGHT_OPEN, 1.0), 4, Loser.RIGHT),
    "left out of reach": (EASY, shifted(2, LEFT_X, 3.0), 2, Loser.LEFT),
    "right is no number": (EASY, shifted(3, RIGHT_X, np.nan), 3, Loser.RIGHT),
    "right grasp": (TRAY, shifted(1, RIGHT_X, 0.06), 1, Loser.RIGHT),
    "both grasps": (
        TRAY,
        lambda keyposes: shifted(1, LEFT_X, 0.06)(shifted(1, RIGHT_X, 0.06)(keyposes)),
        1,
        Loser.COORDINATION,
    ),
    "both stay beside": (TRAY, lambda keyposes: keyposes[:1], 1, Loser.COORDINATION),
    "all but the last, in vain": (TRAY, lambda keyposes: keyposes[:-1], 25, Loser.NOBODY),
}


@pytest.mark.slow
@pytest.mark.parametrize(("task", "change", "index", "loser"), PLANTED.values(), ids=PLANTED.keys())
def test_an_arms_planted_error_is_blamed_on_it(task, change, index, loser):
    found = blamed(task, played(task, change(expert_keyposes(task))))
    assert (found.last_recoverable, found.loser) == (index, loser), found


@pytest.mark.slow
def test_where_things_move_later_blame_compares_with_the_expert_who_looks_again():
    """The plain expert fails this episode."""
    perturb = "nudge:3"
    looks_twice = rereading_keyposes(EASY, perturb, seed=NUDGED_SEED)
    looks_once = np.delete(looks_twice, 1, axis=0)  # at first, and then goes to where things are by now
    blamer, blames = Blamer(EASY, OPTIONS | {"perturb": perturb}), []
    for keyposes in (from_on(5, RIGHT_OPEN, 1.0)(looks_twice), shifted(1, LEFT_X, 0.06)(looks_once)):
        blames.append(blamer.blame(played(EASY, keyposes, NUDGED_SEED, perturb)))
    blamer.close()
    assert [(found.last_recoverable, found.loser) for found in blames] == [(5, Loser.RIGHT), (1, Loser.LEFT)]
    assert blames[1].failure_class == FailureClass.MISSED_GRASP


@pytest.mark.parametrize("control_mode", ["auto", "joint"])
def test_of_joint_actions_only_the_class_is_told(control_mode):
    episode = played("lift_ball", [np.tile([0, 0, 0, -1.5, 0, 1.5, 0, 1], 2)])
    blamer = Blamer("lift_ball", OPTIONS | {"control_mode": control_mode})
    found = blamer.blame(episode)
    blamer.close()
    assert found.loser == Loser.NOT_KEYPOSES
    assert found.last_recoverable is None
    assert found.failure_class in FailureClass


def test_the_verb_says_who_lost_what_and_draws_it(tmp_path, capsys):
    keyposes = expert_keyposes(EASY)
    episode = played(EASY, shifted(1, LEFT_X, 0.06)(keyposes))
    path, output, figure = (tmp_path / name for name in ("record.json", "blame/found.json", "blame/bars.png"))
    record_of(EASY, episode).write(path)
    assert results_diagnose(ResultsDiagnoseConfig(results=path, output=output, figure=figure, workers=1)) == 0
    printed = capsys.readouterr().out
    assert re.search(rf"{SEED} +missed grasp +1 +left arm", printed)
    assert "1 episodes of handover_item_easy, 1 failed" in printed
    assert json.loads(output.read_text())[EASY][0]["recovers"] == [True, False]
    with Image.open(figure) as picture:
        colors = {color for _, color in picture.convert("RGB").getcolors(1 << 20) or ()}
    assert (0, 114, 178) in colors


@pytest.mark.slow
def test_episodes_of_several_policies_and_rungs_are_told_apart(tmp_path, capsys):
    board = Path(__file__).parents[2] / "results/leaderboard"
    for policy in ("peract2", "rvt_lf"):
        shutil.copy(board / f"{TRAY}_{policy}_small_seed1000.json", tmp_path / f"{policy}.json")
    options = OPTIONS | {"perturb": "mass:1"}
    episodes = (played(TRAY, expert_keyposes(TRAY)[:1], perturb="mass:1"),)
    for number in (1, 2):
        evaluation(TRAY, options, *episodes).write(tmp_path / f"{number}.json")
    output, figure = tmp_path / "blame/found.json", tmp_path / "blame/bars.png"
    assert (
        results_diagnose(
            ResultsDiagnoseConfig(results=tmp_path, sample=1, output=output, figure=figure, workers=1)
        )
        == 0
    )
    found = json.loads(output.read_text())[TRAY]
    assert [(Path(one["file"]).name, one["policy"], one["perturb"]) for one in found] == [
        ("1.json", "", "mass:1"),
        ("2.json", "", "mass:1"),
        ("peract2.json", "peract2", ""),
        ("rvt_lf.json", "rvt_lf", ""),
    ]
    names = ["record mass:1 1", "record mass:1 2", "peract2 level 0", "rvt_lf level 0"]
    with Image.open(figure) as picture:
        assert re.findall(rf"{TRAY} (.*?): 1 failed", picture.info["Description"]) == names
    printed = capsys.readouterr().out
    assert all(f"{TRAY} {name}" in printed for name in names)


def test_what_was_played_in_another_world_or_otherwise_is_refused(tmp_path):
    episode = played(TRAY, expert_keyposes(TRAY)[:1])
    record = record_of(TRAY, episode)
    path = tmp_path / "record.json"
    record.write(path)
    path.write_text(path.read_text().replace(record.world, "0" * 12))
    with pytest.raises(BimanualError, match=f"world of {TRAY} is 000000000000"):
        results_diagnose(ResultsDiagnoseConfig(results=path, workers=1))
    record.write(path)
    path.write_text(path.read_text().replace(episode.proof.start, "0" * 64))
    with pytest.raises(BimanualError, match=f"seed {SEED} starts in another state"):
        results_diagnose(ResultsDiagnoseConfig(results=path, workers=1))


def test_only_rows_of_the_policy_that_is_asked_for_are_looked_at(tmp_path, capsys):
    committed = sorted((Path(__file__).parents[2] / "results/leaderboard").glob("lift_ball_peract2_*.json"))[
        0
    ]
    shutil.copy(committed, tmp_path)
    row = json.loads(committed.read_text())
    other = tmp_path / committed.name.replace("peract2", "rvt_lf")
    other.write_text(json.dumps(row | {"config": row["config"] | {"policy": "rvt_lf"}}))
    assert (
        results_diagnose(ResultsDiagnoseConfig(results=tmp_path, policy="rvt_lf", sample=1, workers=1)) == 0
    )
    printed = capsys.readouterr().out
    assert str(other) in printed
    assert str(tmp_path / committed.name) not in printed
    with pytest.raises(InvalidChoice, match=r"policy.*peract2, rvt_lf"):
        results_diagnose(ResultsDiagnoseConfig(results=tmp_path, policy="act"))
    record = tmp_path / "record.json"
    record_of(TRAY, played(TRAY, expert_keyposes(TRAY)[:1])).write(record)
    with pytest.raises(InvalidChoice, match="no row of `benchmark` is there"):
        results_diagnose(ResultsDiagnoseConfig(results=record, policy="peract2"))
