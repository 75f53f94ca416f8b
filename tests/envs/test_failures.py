"""Failures are classified and attributed where the truth is known: one error was planted in the expert's keyposes."""

import json
import re
from functools import partial

import numpy as np
import pytest
from planted_failures import SEED, Keyposes, evaluation, expert_keyposes, from_on, played, shifted
from sample_results import LIGHT

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_bimanual.results.episode import Episode
from lerobot_env_bimanual.commands.results_diagnose import ResultsDiagnoseConfig, results_diagnose
from lerobot_env_bimanual.experts.baselines import play_script
from lerobot_env_bimanual.experts.plans import demonstrator
from lerobot_env_bimanual.experts.runner import replanning
from lerobot_env_bimanual.failures.attribution import Attribution, FailureAttributor, Responsible
from lerobot_env_bimanual.failures.behaviour import behaviour
from lerobot_env_bimanual.failures.classes import FailureClass
from lerobot_env_bimanual.tasks import dual_push_buttons, handover_item
from lerobot_env_bimanual.tasks._handover import hand_over

EASY, TRAY = "handover_item_easy", "lift_tray"
LEFT_X, LEFT_Z, LEFT_QW, LEFT_OPEN, RIGHT_X, RIGHT_OPEN = 0, 2, 3, 7, 9, 16
OPTIONS: dict[str, str | int] = {"split": "test", "max_keyposes": 25}


def attributed(task: str, *episodes: Episode, **options: str) -> list[Attribution]:
    attributor = FailureAttributor(task, OPTIONS | options)
    return [attributor(episode) for episode in episodes]


def one_hand_after_the_other(keyposes: Keyposes) -> Keyposes:
    above, press = keyposes
    left_only, right_only = np.r_[press[:9], above[9:]], np.r_[above[:9], press[9:]]
    return np.array([above, left_only, right_only, above])


def another_item(_: Keyposes) -> Keyposes:
    item = handover_item.ITEMS[1]
    script = partial(hand_over, item=item, left_behind_m=0.005, right_behind_m=0.005)
    return expert_keyposes("handover_item", partial(play_script, script=script))


def another_button(_: Keyposes) -> Keyposes:
    def script(scene):
        left, right, other = dual_push_buttons.LEFT, dual_push_buttons.RIGHT, dual_push_buttons.OTHER
        is_leftmost = scene.pose(other).position[1] > scene.pose(left).position[1]
        return dual_push_buttons.press(scene, *((other, right) if is_leftmost else (left, other)))

    return expert_keyposes("dual_push_buttons", partial(play_script, script=script))


C, R = FailureClass, Responsible
ERRORS = {
    "not a number": (EASY, from_on(2, LEFT_QW, np.nan), C.INVALID_ACTION, 2, R.LEFT),
    "the right arm's is not a number": (EASY, shifted(3, RIGHT_X, np.nan), C.INVALID_ACTION, 3, R.RIGHT),
    "a pose beyond the workspace": (EASY, from_on(2, LEFT_X, 3.0), C.UNREACHABLE, 2, R.LEFT),
    "a hand pushed into the table": (TRAY, shifted(1, LEFT_Z, -0.12), C.COLLISION, 1, R.LEFT),
    "the item of another colour": ("handover_item", another_item, C.WRONG_OBJECT, 1, R.LEFT),
    "a button of another colour": ("dual_push_buttons", another_button, C.WRONG_OBJECT, 25, R.TIME),
    "a hand that opens early": (EASY, from_on(3, LEFT_OPEN, 1.0), C.DROPPED, 3, R.LEFT),
    "a left grasp beside the item": (EASY, shifted(1, LEFT_X, 0.06), C.MISSED_GRASP, 1, R.LEFT),
    "a right grasp beside the rim": (TRAY, shifted(1, RIGHT_X, 0.06), C.MISSED_GRASP, 1, R.RIGHT),
    "both grasps": (TRAY, shifted(1, [LEFT_X, RIGHT_X], 0.06), C.MISSED_GRASP, 1, R.COORDINATION),
    "a hand that does not take over": (EASY, from_on(4, RIGHT_X, 0.15), C.MISSED_GRASP, 4, R.RIGHT),
    "a hand that never closes": (EASY, from_on(4, RIGHT_OPEN, 1.0), C.OUT_OF_TIME, 4, R.RIGHT),
    "one hand after the other": ("dual_push_buttons", one_hand_after_the_other, C.OUT_OF_STEP, 25, R.TIME),
    "hands that never come": ("lift_ball", lambda keyposes: keyposes[:1], C.OUT_OF_TIME, 1, R.COORDINATION),
    "all but the last": (TRAY, lambda keyposes: keyposes[:-1], C.OUT_OF_TIME, 25, R.TIME),
}


@pytest.mark.parametrize(
    ("task", "change", "kind", "index", "responsible"), ERRORS.values(), ids=ERRORS.keys()
)
def test_a_planted_error_gets_its_class_and_is_attributed_to_its_arm(task, change, kind, index, responsible):
    (found,) = attributed(task, played(task, change(expert_keyposes(task))))
    assert (found.failure_class, bool(found.event)) == (kind, True), found
    assert (found.last_recoverable, found.responsible) == (index, responsible), found


@pytest.mark.parametrize("plan", [0, 1])
def test_the_expert_that_takes_over_follows_the_plan_that_both_arms_follow(plan):
    seed = 2_150_005
    keyposes = expert_keyposes("dual_push_buttons", partial(demonstrator, plan=plan), seed)
    too_high = shifted(1, LEFT_Z, 0.06)(keyposes)
    (found,) = attributed("dual_push_buttons", played("dual_push_buttons", too_high, seed))
    assert (found.last_recoverable, found.responsible) == (25, Responsible.TIME), found


@pytest.mark.slow
def test_under_a_nudge_the_replanning_expert_takes_over():
    """The open-loop expert fails this episode."""
    seed, perturb = 40_004, "nudge:3"
    replanned = expert_keyposes(EASY, replanning(), seed, perturb)
    once = np.delete(replanned, 1, axis=0)  # plans at the start, then goes to where the item was moved to
    errors = (from_on(5, RIGHT_OPEN, 1.0)(replanned), shifted(1, LEFT_X, 0.06)(once))
    found = attributed(EASY, *(played(EASY, keyposes, seed, perturb) for keyposes in errors), perturb=perturb)
    attributions = [(one.last_recoverable, one.responsible) for one in found]
    assert attributions == [(5, Responsible.RIGHT), (1, Responsible.LEFT)]
    assert found[1].failure_class == FailureClass.MISSED_GRASP


def test_under_misses_the_expert_that_takes_over_does_not_miss_again():
    perturb = "misses:3"
    keyposes = expert_keyposes(EASY, replanning(), 1, perturb)[:-1]
    (found,) = attributed(EASY, played(EASY, keyposes, 1, perturb), perturb=perturb)
    assert (found.last_recoverable, found.responsible) == (25, Responsible.TIME), found


def test_a_hand_that_closes_for_a_tick_now_and_then_has_not_closed():
    joint_actions = np.tile([0, 0, 0, -1.5, 0, 1.5, 0, 1], (300, 2))
    joint_actions[::50, 7] = 0
    (found,) = attributed(EASY, played(EASY, joint_actions))
    assert found.failure_class == FailureClass.OUT_OF_TIME


@pytest.mark.parametrize("control_mode", ["auto", "joint"])
def test_joint_actions_get_a_class_only(control_mode):
    episode = played("lift_ball", [np.tile([0, 0, 0, -1.5, 0, 1.5, 0, 1], 2)])
    (found,) = attributed("lift_ball", episode, control_mode=control_mode)
    assert (found.responsible, found.last_recoverable) == (Responsible.JOINT_ACTIONS, None)
    assert found.failure_class in FailureClass


def test_the_command_prints_and_writes_what_it_found(tmp_path, capsys):
    path, output = tmp_path / "record.json", tmp_path / "failures/found.json"
    evaluation(EASY, OPTIONS, played(EASY, shifted(1, LEFT_X, 0.06)(expert_keyposes(EASY)))).write(path)
    assert results_diagnose(ResultsDiagnoseConfig(results=path, output=output, workers=1)) == 0
    printed = capsys.readouterr()
    assert re.search(rf"{SEED} +missed grasp +1 +left arm", printed.out)
    assert re.search(r"left arm +failed\nhandover_item_easy record +0/1 +17% +\S+, \S+ +– +1 +1", printed.out)
    assert printed.err.endswith(f"next: lerobot-bimanual results report --results={path}\n")
    (found,) = json.loads(output.read_text())["failures"][EASY]
    assert (found["responsible"], found["perturb"], found["file"]) == ("left arm", "", str(path))


def test_behaviour_reports_partial_credit_force_and_time_relative_to_the_expert():
    solved = Episode(seed=0, success=True, ticks=30, load=LIGHT)
    lost = Episode(seed=1, success=False, failure="out of time", ticks=90, load=LIGHT)
    half = Attribution(1, 0, FailureClass.DROPPED, "", 3, 0.5, Responsible.LEFT)
    assert behaviour([solved, lost], [half], {0: 20, 1: 20}) == {
        "solved": "1/2",
        "keyposes reached": "75%",
        "force, N": "5, 5",
        "time / expert's": "1.50",
    }
    without = [each.model_copy(update={"load": None}) for each in (solved, lost)]
    assert [*behaviour(without, [], {}).values()] == ["1/2", "–", "–", "–"]


def test_results_that_cannot_be_replayed_here_are_refused(tmp_path):
    episode = played(TRAY, expert_keyposes(TRAY)[:1])
    record, path = evaluation(TRAY, OPTIONS, episode), tmp_path / "record.json"
    messages = {record.world: f"world of {TRAY} is 0", episode.proof.start: f"seed {SEED} starts"}
    for digits, message in messages.items():
        record.write(path)
        path.write_text(path.read_text().replace(digits, "0" * len(digits)))
        with pytest.raises(BimanualError, match=message):
            results_diagnose(ResultsDiagnoseConfig(results=path, workers=1))
    with pytest.raises(InvalidChoice, match="policy is 'peract2', but must be one of: record"):
        results_diagnose(ResultsDiagnoseConfig(results=path, policy="peract2"))
