"""One failure of every kind is planted on real tasks, and told from the others."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from planted_failures import SEED, Keyposes, expert_keyposes, from_on, shifted

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.errors import InvalidAction
from lerobot_env_bimanual.audit.failure_class import FailureClass, failure_class
from lerobot_env_bimanual.audit.witness import EpisodeFacts, EpisodeWitness, other_conditions
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks import dual_push_buttons, handover_item
from lerobot_env_bimanual.tasks._handover import hand_over
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.vector.hold_after_done import INVALID_ACTION

pytestmark = pytest.mark.sim

LEFT_Y, LEFT_X, LEFT_QW, LEFT_OPEN = 1, 0, 3, 7
LEFT_Z, RIGHT_X = 2, 9
EASY = "handover_item_easy"


def witnessed(task: str, keyposes: Keyposes) -> EpisodeFacts:
    """What happens when these are played, the last of them until the episode is over."""
    env = BimanualEnv(task, obs="state")
    env.reset(seed=SEED, options={"variation": 0})
    witness = EpisodeWitness(env)
    with env.observed_by(witness.note, witness.note_step):
        is_over, index = False, 0
        while not is_over:
            try:
                _, _, terminated, truncated, _ = env.step(keyposes[min(index, len(keyposes) - 1)])
            except InvalidAction as error:
                _, _, terminated, truncated, _ = env.fail(f"{INVALID_ACTION}{error}")
            is_over, index = terminated or truncated, index + 1
    facts = witness.facts()
    env.close()
    return facts


def one_hand_after_the_other(keyposes: Keyposes) -> Keyposes:
    above, press = keyposes
    left_only, right_only = np.r_[press[:9], above[9:]], np.r_[above[:9], press[9:]]
    return np.array([above, left_only, right_only, above])


def another_item(_: Keyposes) -> Keyposes:
    item = handover_item.ITEMS[1]
    script = partial(hand_over, item=item, left_behind_m=0.005, right_behind_m=0.005)
    return expert_keyposes("handover_item", script=script)


def another_button(_: Keyposes) -> Keyposes:
    def script(scene):
        left, right, other = dual_push_buttons.LEFT, dual_push_buttons.RIGHT, dual_push_buttons.OTHER
        is_leftmost = scene.pose(other).position[1] > scene.pose(left).position[1]
        return dual_push_buttons.press(scene, *((other, right) if is_leftmost else (left, other)))

    return expert_keyposes("dual_push_buttons", script=script)


PLANTED = {
    "a number that is none": (EASY, from_on(2, LEFT_QW, np.nan), FailureClass.INVALID_ACTION),
    "a pose beyond the workspace": (EASY, from_on(2, LEFT_X, 3.0), FailureClass.UNREACHABLE),
    "a hand pushed into the table": ("lift_tray", shifted(1, LEFT_Z, -0.2), FailureClass.COLLISION),
    "the item of another colour": ("handover_item", another_item, FailureClass.WRONG_OBJECT),
    "a button of another colour": ("dual_push_buttons", another_button, FailureClass.WRONG_OBJECT),
    "a hand that opens early": (EASY, from_on(3, LEFT_OPEN, 1.0), FailureClass.DROPPED),
    "a left grasp beside the item": (EASY, shifted(1, LEFT_X, 0.06), FailureClass.MISSED_GRASP),
    "a right grasp beside the rim": ("lift_tray", shifted(1, RIGHT_X, 0.06), FailureClass.MISSED_GRASP),
    "a hand that takes nothing over": (EASY, from_on(4, RIGHT_X, 0.15), FailureClass.MISSED_GRASP),
    "one hand after the other": (
        "dual_push_buttons",
        one_hand_after_the_other,
        FailureClass.OUT_OF_STEP,
    ),
    "hands that never come": ("lift_ball", lambda keyposes: keyposes[:1], FailureClass.OUT_OF_TIME),
}


@pytest.mark.parametrize(("task", "change", "kind"), PLANTED.values(), ids=PLANTED.keys())
def test_a_planted_failure_is_told_from_the_others(task, change, kind):
    keyposes = expert_keyposes(task)
    expert = witnessed(task, keyposes)
    assert expert.met_together
    assert not expert.unmet
    found, fact = failure_class(task, witnessed(task, change(keyposes)), expert)
    assert found == kind, fact
    assert fact


def test_of_several_kinds_the_first_counts():
    nothing = EpisodeFacts("", False, 0.0, frozenset(), frozenset(), {}, {}, (), ("a",), False, frozenset())
    expert = replace(nothing, gripped=frozenset({(Arm.LEFT, "item")}), touched=frozenset({"item"}))
    facts = replace(
        nothing,
        failure=f"{INVALID_ACTION}NaN",
        unstable=True,
        gripped=frozenset({(Arm.RIGHT, "other"), (Arm.RIGHT, "item")}),
        closed={Arm.LEFT: 8},
        lost={"item": 7},
        met=("a",),
        unmet=(),
    )
    undone = {
        FailureClass.INVALID_ACTION: {"failure": "left arm: out of reach"},
        FailureClass.UNREACHABLE: {"failure": ""},
        FailureClass.COLLISION: {"unstable": False},
        FailureClass.WRONG_OBJECT: {"gripped": frozenset({(Arm.RIGHT, "item")})},
        FailureClass.DROPPED: {"lost": {}},
        FailureClass.MISSED_GRASP: {"closed": {}},
        FailureClass.OUT_OF_STEP: {"met": (), "unmet": ("a",)},
        FailureClass.OUT_OF_TIME: {},
    }
    assert list(undone) == list(FailureClass)
    for kind, change in undone.items():
        assert failure_class("lift_ball", facts, expert)[0] == kind
        facts = replace(facts, **change)


@pytest.mark.parametrize("task", list_tasks())
def test_other_conditions_are_of_what_nobody_asked_for(task):
    definition = get_task(task)
    for variation in definition.spec.variations:
        others = set(other_conditions(definition, variation))
        assert not others & set(definition.conditions(variation))


@pytest.mark.slow
@pytest.mark.parametrize("task", list_tasks())
def test_whoever_stops_half_way_touched_nothing_wrong(task):
    keyposes = expert_keyposes(task)
    expert = witnessed(task, keyposes)
    found, fact = failure_class(task, witnessed(task, keyposes[: len(keyposes) // 2]), expert)
    assert found in (FailureClass.OUT_OF_TIME, FailureClass.OUT_OF_STEP), fact
