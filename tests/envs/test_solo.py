"""One arm alone: every task is tried, the other arm never moves, and what one sees does not depend on who tried."""

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.keypose import BimanualKeypose
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert.controls import make_control
from lerobot_env_bimanual.expert.instruction_scripts import readings
from lerobot_env_bimanual.expert.runner import run_episode
from lerobot_env_bimanual.solo.ways import alone, find_ways
from lerobot_env_bimanual.tasks.dual_push_buttons import COLORS, TRIPLES
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

SEED = 0
ARM_NAMES = [arm.value for arm in ARMS]
VARIED = [name for name in list_tasks() if len(get_task(name).spec.variations) > 1]


@pytest.fixture(scope="module")
def env_of():
    envs = {}

    def get(name):
        if name not in envs:
            envs[name] = BimanualEnv(name, obs="state", split="val")
        return envs[name]

    yield get
    for env in envs.values():
        env.close()


@pytest.mark.parametrize("name", list_tasks())
def test_every_task_is_tried_by_either_arm(env_of, name):
    env = env_of(name)
    env.reset(seed=SEED)
    find = find_ways(name)
    assert find is not None
    for arm in ARMS:
        assert list(find(env.scene, env.progress.variation, arm))


def test_a_task_without_a_module_is_an_error_and_no_failure_of_one_arm():
    with pytest.raises(BimanualError, match="how one arm would try 'no_such_task'"):
        find_ways("no_such_task")


@pytest.mark.parametrize("name", list_tasks())
def test_a_way_leaves_the_other_arm_alone(env_of, name):
    env = env_of(name)
    env.reset(seed=SEED)
    for arm in ARMS:
        for way in find_ways(name)(env.scene, env.progress.variation, arm):
            stages = list(way(env.scene))
            assert stages
            for stage in stages:
                other = "right" if arm is Arm.LEFT else "left"
                assert getattr(stage, other) is None
                assert getattr(stage, f"{other}_open") is None
                assert getattr(stage, f"{other}_holds") is None


def test_alone_names_one_arm_only():
    stage = alone(Arm.RIGHT, "close", is_open=False)
    assert (stage.right_open, stage.left_open, stage.left, stage.right) == (False, None, None, None)


@pytest.mark.slow
@pytest.mark.sim
@pytest.mark.parametrize("arm", ARM_NAMES)
@pytest.mark.parametrize("name", list_tasks())
def test_the_other_arm_stays_at_home_and_the_episode_is_determined(env_of, name, arm):
    other = "right" if arm == "left" else "left"
    env, outcomes = env_of(name), []
    for _ in range(2):
        moves = []
        outcomes.append(run_episode(env, SEED, make_control(f"solo_{arm}", 0), moves.append))
        env.reset(seed=SEED)
        home = env.scene.tcp(Arm(other))
        for move in moves:
            target = BimanualKeypose.from_vector(move.action)[Arm(other)]
            assert target.pose.distance_to(home) == pytest.approx((0, 0), abs=1e-3)
            assert target.gripper_open
    assert outcomes[0] == outcomes[1]


@pytest.mark.sim
def test_one_arm_solves_what_the_certificates_say_it_solves(env_of):
    assert run_episode(env_of("pick_laptop"), SEED, make_control("solo_left", 0)).success
    assert not run_episode(env_of("lift_ball"), SEED, make_control("solo_left", 0)).success


@pytest.mark.parametrize("name", VARIED)
def test_one_of_the_readings_of_a_scene_is_the_right_one(env_of, name):
    env = env_of(name)
    for variation in get_task(name).spec.variations:
        env.reset(seed=SEED, options={"variation": variation.index})
        first = [next(iter(script(env.scene))) for script in readings(env.task_definition, env.scene)]
        expert = next(iter(env.task_definition.script(env.scene, variation)))
        poses = [_poses(stage) for stage in first]
        assert any(np.allclose(pose, _poses(expert)) for pose in poses)
        assert len({tuple(pose.round(6)) for pose in poses}) == len(poses)


def _poses(stage) -> np.ndarray:
    poses = [pose for pose in (stage.left, stage.right) if pose is not None]
    return np.concatenate([pose.matrix.ravel() for pose in poses])


def test_no_colour_of_a_button_tells_whether_it_is_meant():
    targets = {color for *asked_for, _ in TRIPLES for color in asked_for}
    left_alone = {other for *_, other in TRIPLES}
    assert targets == left_alone == set(COLORS)
    answers = [frozenset(triple[:2]) for triple in TRIPLES]
    assert len(set(answers)) == len(answers)
    for triple in TRIPLES:
        assert sum(set(triple) == set(other) for other in TRIPLES) > 1
