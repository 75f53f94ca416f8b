"""With one arm, known ways solve tasks that do not need two, and some scenes of three others; both arms' keyposes vary."""

from pathlib import Path

import coordination
import numpy as np
import pytest
from adversaries.ways import SOLVED_BY_ONE_ARM, UNSOLVED_BY_ONE_ARM, one_armed, tally

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.joint_action import by_arm
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts import baselines
from lerobot_env_bimanual.experts.runner import run_episode
from lerobot_env_bimanual.options import SETTINGS
from lerobot_env_bimanual.tasks.registry import list_tasks

pytestmark = pytest.mark.weekly

RECORDED = np.load(Path(__file__).with_name("one_arm.npz"))
"""Joint actions (ticks, 16) by task and test seed."""


@pytest.mark.parametrize(("task", "arm"), SOLVED_BY_ONE_ARM)
def test_one_arm_solves_a_task_that_does_not_need_two_while_the_other_stays_at_home(task, arm):
    env = BimanualEnv(task, obs="state", split="test")
    assert any(run_episode(env, seed, one_armed(Arm(arm))).success for seed in range(61_000, 61_004))
    other = Arm(arm).other.ordinal
    commanded = by_arm(env.scene.commanded)[other]
    assert commanded[:-1] == pytest.approx(env.scene.arm_pair.home_joints, abs=1e-3)
    assert commanded[-1] == 1


def test_pushing_the_box_with_the_left_arm_alone_by_joint_targets_found_by_search_does_not_count():
    env = BimanualEnv("push_box", obs="state", split="test", control_mode="joint", protective_stop=True)
    env.reset(seed=9_000_000)
    action = env.scene.commanded
    for action[:8] in np.load(Path(__file__).with_name("push_box_left_arm.npy")):
        env.step(action)
    assert not env.progress.succeeded
    assert [name for name, is_met in env.progress.conditions.items() if not is_met] == [
        "once(touched(box, left) and touched(box, right))"
    ]


@pytest.mark.parametrize("name", RECORDED)
def test_joint_targets_found_by_search_solve_some_scenes_with_one_arm(name):
    task, seed = name.rsplit("_", 1)
    env = BimanualEnv(task, obs="state", split="test", control_mode="joint")
    env.reset(seed=int(seed))
    idle = 0 if task in ("lift_ball", "sweep_to_dustpan") else 1
    home = by_arm(env.scene.commanded)[idle].copy()
    for action in RECORDED[name]:
        assert by_arm(action)[idle] == pytest.approx(home, abs=1e-6)
        env.step(action)
    assert env.progress.succeeded


@pytest.mark.parametrize(("task", "arm"), UNSOLVED_BY_ONE_ARM)
def test_no_way_of_the_examples_does_another_task_with_one_arm(task, arm):
    solved, solved_by_end_state = tally(task, Arm(arm), range(1_200_000, 1_200_003))
    assert not solved
    # Without the conditions on the way they do it.
    if (task, arm) == ("sweep_to_dustpan", "left") or task.startswith(
        ("pick_plate", "put_bottle", "handover")
    ):
        assert len(solved_by_end_state) >= 2


@pytest.mark.parametrize("setting", SETTINGS)
@pytest.mark.parametrize("task", list_tasks())
def test_keyposes_of_both_arms_vary(task, setting, monkeypatch):
    monkeypatch.setattr(baselines, "DEMONSTRATIONS", 12)
    monkeypatch.setattr(coordination, "demonstrations", baselines.demonstrations.__wrapped__)
    for row in coordination.spread(task, setting):
        assert max(map(float, row["place, cm"].split(" to "))) > 2, row
