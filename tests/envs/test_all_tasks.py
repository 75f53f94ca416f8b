"""What every task has to satisfy; a new task is tested by being registered."""

import ast
import inspect
import re
import sys
from itertools import product

import numpy as np
import pytest

from lerobot_bimanual.arms import Arm
from lerobot_bimanual.geometry.pose import Pose
from lerobot_env_bimanual.conditions import check
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.experts.runner import expert, run_episode
from lerobot_env_bimanual.props.block import Block
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.world.scene import Scene
from lerobot_env_bimanual.world.servo_commands import TICK_S

SEEDS = (11, 12, 13)


@pytest.fixture(scope="module", params=list_tasks())
def env(request):
    return BimanualEnv(request.param, obs="state", split="val")


@pytest.mark.parametrize("name", list_tasks())
def test_the_specification_is_consistent(name):
    spec = get_task(name).spec
    assert spec.horizon_ticks > 0
    props = [prop.name for prop in spec.props]
    assert len(set(props)) == len(props) > 0
    (varied,) = {tuple(prop.name for prop in each) for each in spec.prop_sets("varied")}
    assert {*props} <= {*varied}
    for variation in spec.variations:
        instructions = spec.instructions_for(variation)
        assert all(instruction.strip() == instruction != "" for instruction in instructions)
        assert len(set(instructions)) == len(instructions) > 0
    canonical = [spec.instructions_for(variation)[0] for variation in spec.variations]
    assert len(set(canonical)) == len(canonical), "a policy could not tell the variations apart"


@pytest.mark.parametrize("name", list_tasks())
def test_a_task_file_documents_arms_and_departures_is_short_and_imports_no_mujoco(name):
    module = sys.modules[type(get_task(name)).__module__]
    source = inspect.getsource(module)
    docstring = inspect.getdoc(module)
    assert re.search(r"(one|other|each|two|both|second) (arm|hand)", docstring.lower())
    assert "Departures from the original" in docstring
    assert len(source.splitlines()) <= 200
    imported = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Import | ast.ImportFrom)]
    modules = [getattr(node, "module", None) or node.names[0].name for node in imported]
    assert not any(name.endswith((".gl", "mujoco", ".env")) for name in modules)


def test_resets_are_stable_unsolved_and_distinct_and_a_step_reports_the_current_conditions(env):
    hashes = set()
    for seed in SEEDS:
        _, info = env.reset(seed=seed)
        assert not env.scene.unstable
        assert not info["is_success"]
        assert not all(info["conditions"].values())
        assert info["failure"] == ""
        hashes.add(env.state_hash())
    assert len(hashes) == len(SEEDS)
    *_, info = env.step(env.scene.commanded)
    conditions = env.task_definition.conditions(env.progress.variation)
    now = check(conditions, env.scene, env.progress.history_conditions)
    assert info["conditions"] == now


def test_the_same_seed_gives_the_same_state_after_any_history(env):
    env.reset(seed=SEEDS[0])
    fresh = env.state_hash()
    env.reset(seed=SEEDS[1])
    for _ in range(5):
        env.step(np.zeros(16, dtype=np.float32))
    env.reset(seed=SEEDS[0])
    assert env.state_hash() == fresh
    other = BimanualEnv(env.task, obs="state", split="val")
    other.reset(seed=SEEDS[0])
    assert other.state_hash() == fresh


def sleepers(scene: Scene) -> int:
    return int((scene.data.tree_asleep >= 0).sum())


def test_a_thing_at_rest_sleeps_until_a_reset_and_the_arms_never_do():
    scene = Scene([Block()])
    scene.place("item", Pose.upright((0.25, 0.1, 0.79)))
    scene.settle(20)
    assert sleepers(scene) == 1
    assert scene.speed("item") == 0
    assert list(scene.data.tree_asleep[:2] < 0) == [True, True]
    scene.reset()
    assert sleepers(scene) == 0
    scene.place("item", Pose.upright((0.1, -0.2, 0.9)))
    assert scene.pose("item").position == pytest.approx((0.1, -0.2, 0.9))


def test_a_rope_is_laid_down_at_rest_and_sleeps_after_a_tick():
    env = BimanualEnv("straighten_rope", split="val", obs="state")
    env.reset(seed=0)
    scene, ends_m = env.scene, [env.scene.pose(body).position for body in ("rope", "rope_17")]
    assert sleepers(scene) == 1
    assert scene.data.time == pytest.approx(TICK_S)  # of settling
    env.step(scene.commanded)
    assert np.allclose([scene.pose(body).position for body in ("rope", "rope_17")], ends_m, atol=1e-6)


@pytest.mark.parametrize("name", list_tasks())
def test_an_episode_goes_on_bit_for_bit_from_states_with_and_without_sleepers(name):
    env = BimanualEnv(name, split="val", obs="state")
    states, actions, hashes, slept = [], [], [], []

    def note(env, action):
        states.append(env.scene.save_state())
        actions.append(action.copy())
        hashes.append(env.scene.state_hash())
        slept.append(sleepers(env.scene))
        # A contact wakes a body, so no hand touches a sleeping one.
        for arm, tree in product(Arm, np.flatnonzero(env.scene.data.tree_asleep >= 0)):
            body = env.scene.model.body(env.scene.model.tree_bodyadr[tree]).name
            assert not env.scene.touching(arm, body)

    env.tick_observers.append(note)
    assert run_episode(env, 3, expert()).success
    assert any(slept)
    other = Scene(env.task_definition.spec.props)
    changes = np.flatnonzero(np.diff(slept)).tolist()  # something falls asleep or wakes
    for start in {0, *changes[:6], len(states) // 2}:
        other.restore_state(states[start])
        assert other.state_hash() == hashes[start]
        for tick in range(start, min(start + 8, len(states) - 1)):
            other.tick(actions[tick])
            assert other.state_hash() == hashes[tick + 1], (start, tick)
