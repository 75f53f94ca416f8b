"""What every task has to satisfy; a new task is tested by being registered."""

import ast
import inspect
import re
import sys

import numpy as np
import pytest

from lerobot_bimanual.arms import ARMS
from lerobot_bimanual.geometry.workspace import VOXEL_WORKSPACE
from lerobot_env_bimanual.conditions import check
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks

SEEDS = (11, 12, 13)


@pytest.fixture(scope="module", params=list_tasks())
def env(request):
    env = BimanualEnv(request.param, obs="state", split="val")
    yield env
    env.close()


@pytest.mark.parametrize("name", list_tasks())
def test_the_specification_is_consistent(name):
    task = get_task(name)
    spec = task.spec
    assert type(task).__module__ == f"lerobot_env_bimanual.tasks.{name}"
    assert spec.name == name
    assert [variation.index for variation in spec.variations] == list(range(len(spec.variations)))
    assert spec.horizon_ticks > 0
    props = [prop.name for prop in spec.props]
    assert len(set(props)) == len(props) > 0
    for variation in spec.variations:
        names = [condition.name for condition in task.conditions(variation)]
        assert len(set(names)) == len(names) > 0
        instructions = spec.instructions_for(variation)
        assert all(instruction.strip() == instruction != "" for instruction in instructions)
        assert not any("{" in instruction for instruction in instructions)
        assert len(set(instructions)) == len(instructions) > 0
    canonical = [spec.instructions_for(variation)[0] for variation in spec.variations]
    assert len(set(canonical)) == len(canonical), "a policy could not tell the variations apart"


@pytest.mark.parametrize("name", list_tasks())
def test_the_file_tells_what_the_arms_do_and_what_differs_and_hides_no_mujoco(name):
    module = sys.modules[type(get_task(name)).__module__]
    source = inspect.getsource(module)
    docstring = inspect.getdoc(module)
    assert re.search(r"(one|other|each|two|both|second) (arm|hand)", docstring.lower())
    assert "Departures from the original" in docstring
    assert len(source.splitlines()) <= 200
    imported = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Import | ast.ImportFrom)]
    modules = [getattr(node, "module", None) or node.names[0].name for node in imported]
    assert not any(name.endswith((".gl", "mujoco", ".env")) for name in modules)


def test_resets_are_quiet_unsolved_and_different_and_tell_conditions_as_they_are(env):
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
    now = check(conditions, env.scene, env.progress.on_the_way)
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
    other.close()


def test_the_script_begins_with_a_planned_move_inside_the_voxel_grid(env):
    env.reset(seed=SEEDS[0])
    script = env.task_definition.script(env.scene, env.progress.variation)
    first = next(script)
    assert first.planned
    for arm in ARMS:
        pose = getattr(first, arm.value)
        assert pose is None or VOXEL_WORKSPACE.contains(pose.position)
