"""What every task has to satisfy; a new task is tested by being registered."""

import ast
import inspect
import re
import sys

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

SEEDS = (11, 12, 13)


@pytest.fixture(params=list_tasks())
def name(request):
    return request.param


@pytest.fixture
def task(name):
    return get_task(name)


@pytest.fixture(scope="module")
def environments():
    opened = {}
    yield opened
    for env in opened.values():
        env.close()


@pytest.fixture
def env(name, environments):
    if name not in environments:
        environments[name] = BimanualEnv(name, obs="state", split="val")
    return environments[name]


def test_the_specification_is_consistent(name, task):
    spec = task.spec
    assert type(task).__module__ == f"lerobot_env_bimanual.tasks.{name}"
    assert spec.name == name
    assert [variation.index for variation in spec.variations] == list(range(len(spec.variations)))
    assert spec.horizon_ticks > 0
    props = [prop.name for prop in spec.props]
    assert len(set(props)) == len(props) > 0


def test_every_variation_has_distinct_conditions_and_instructions(task):
    for variation in task.spec.variations:
        names = [condition.name for condition in task.conditions(variation)]
        assert len(set(names)) == len(names) > 0
        instructions = task.spec.instructions_for(variation)
        assert all(instruction.strip() == instruction != "" for instruction in instructions)
        assert not any("{" in instruction for instruction in instructions)
        assert len(set(instructions)) == len(instructions) > 0
    canonical = [task.spec.instructions_for(variation)[0] for variation in task.spec.variations]
    assert len(set(canonical)) == len(canonical), "a policy could not tell the variations apart"


def test_the_file_tells_what_the_arms_do_and_what_differs_and_hides_no_mujoco(task):
    module = sys.modules[type(task).__module__]
    source = inspect.getsource(module)
    docstring = inspect.getdoc(module)
    assert re.search(r"(one|other|each|two|both|second) (arm|hand)", docstring.lower())
    assert "Departures from the original" in docstring
    assert len(source.splitlines()) <= 200
    imported = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Import | ast.ImportFrom)]
    modules = [getattr(node, "module", None) or node.names[0].name for node in imported]
    assert not any(name.endswith((".gl", "mujoco", ".env")) for name in modules)


def test_resets_are_quiet_unsolved_and_different(env):
    hashes = set()
    for seed in SEEDS:
        _, info = env.reset(seed=seed)
        assert not env.scene.unstable
        assert not info["is_success"]
        assert not all(info["conditions"].values())
        assert info["failure"] == ""
        hashes.add(env.state_hash())
    assert len(hashes) == len(SEEDS)


def test_conditions_are_told_as_they_are_after_a_tick(env):
    env.reset(seed=SEEDS[0])
    *_, info = env.step(env.scene.commanded)
    conditions = env.task_definition.conditions(env.progress.variation)
    assert info["conditions"] == {condition.name: condition(env.scene) for condition in conditions}


def test_the_same_seed_gives_the_same_state_after_any_history(name, env):
    env.reset(seed=SEEDS[0])
    fresh = env.state_hash()
    env.reset(seed=SEEDS[1])
    for _ in range(5):
        env.step(np.zeros(16, dtype=np.float32))
    env.reset(seed=SEEDS[0])
    assert env.state_hash() == fresh
    other = BimanualEnv(name, obs="state", split="val")
    other.reset(seed=SEEDS[0])
    assert other.state_hash() == fresh
    other.close()


def test_the_script_begins_with_a_planned_move_inside_the_voxel_grid(env):
    env.reset(seed=SEEDS[0])
    script = env.task_definition.script(env.scene, env.progress.variation)
    first = next(script)
    assert first.planned
    for arm in ARMS:
        pose = getattr(first, arm.value)
        assert pose is None or VOXEL_WORKSPACE.contains(pose.position)
