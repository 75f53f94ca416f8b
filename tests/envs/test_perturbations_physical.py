"""Axes that change more than what is seen: the same episodes, changed by one dial, wherever and whenever they are played."""

from __future__ import annotations

import pickle
from itertools import product

import numpy as np
import pytest

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.expert.controls import make_control
from lerobot_env_bimanual.expert.runner import expert, run_episode, run_expert
from lerobot_env_bimanual.options import EnvOptions
from lerobot_env_bimanual.perturbation_choice import MAX_LEVEL
from lerobot_env_bimanual.perturbations.axis import Group
from lerobot_env_bimanual.perturbations.registry import get_axis, list_axes
from lerobot_env_bimanual.tasks.registry import get_task, list_tasks
from lerobot_env_bimanual.vector import LazyVectorEnv
from lerobot_env_bimanual.world.arena import build_spec
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR

AXES = [name for name in list_axes() if not get_axis(name).is_seen_only]
LEVELS = range(1, MAX_LEVEL + 1)
TICKS = 30
"""Enough for whatever happens once, and for commands that are late."""
FEW_TASKS = ("handover_item_easy", "put_item_in_drawer")
"""One of them has what an axis changes: things that move freely, joints."""
MOST_SHIFTED_M = 0.05


def applies(axis: str, task: str) -> bool:
    spec = get_task(task).spec
    return get_axis(axis).applies_to(spec, build_spec(spec.props, PANDA_PAIR))


def make(task: str, axis: str = "", level: int = 3, **keywords) -> BimanualEnv:
    perturb = f"{axis}:{level}" if axis else ""
    return BimanualEnv(task, obs="state", split="val", perturb=perturb, **keywords)


def wiggle(seed: int, ticks: int = TICKS) -> np.ndarray:
    """Joint actions (ticks, 16) relative to where the arms stand."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(-0.01, 0.01, (ticks, 16)), axis=0).astype(np.float32)


def hashes(env: BimanualEnv, moves: np.ndarray, start: np.ndarray) -> list[str]:
    """The state after each tick."""
    found = []
    for move in moves:
        env.step(start + move)
        found.append(env.state_hash())
    return found


def task_of(axis: str) -> str:
    return next(task for task in FEW_TASKS if applies(axis, task))


def episode_of(env: BimanualEnv) -> tuple:
    """What a seed draws, and where it puts what the task has, by name."""
    progress, scene = env.progress, env.scene
    props = env.task_definition.spec.props
    return (
        progress.variation,
        progress.instruction,
        progress.draws,
        progress.rng.bit_generator.state,
        {prop.name: scene.pose(prop.name).position for prop in props},
    )


@pytest.mark.parametrize("axis", AXES)
def test_a_seed_means_the_same_episode_at_every_level_and_every_level_is_another_world(axis):
    task, worlds = task_of(axis), []
    for level in (0, *LEVELS):
        env = make(task, axis if level else "", level)
        env.reset(seed=5)
        worlds.append((episode_of(env), hashes(env, wiggle(1), np.zeros(16, np.float32))[-1]))
        env.close()
    (*plain, places), _ = worlds[0]
    for (*drawn, placed), _ in worlds[1:]:
        assert drawn == plain
        for name, place in places.items():
            assert np.linalg.norm(placed[name] - place) < MOST_SHIFTED_M, name
    assert len({last for _, last in worlds}) == len(worlds)


@pytest.mark.parametrize("axis", AXES)
def test_an_episode_is_the_same_wherever_it_is_played(axis):
    env, moves = make(task_of(axis), axis), wiggle(2)
    env.reset(seed=3)
    start = env.scene.commanded
    first = hashes(env, moves, start)

    env.reset(seed=4)  # another episode, left in the middle
    hashes(env, moves[: TICKS // 2], start)
    env.reset(seed=3)
    before, half = hashes(env, moves[:7], start), env.save_state()
    assert before == first[:7]
    assert hashes(env, moves[7:], start) == first[7:]
    env.reset(seed=4)
    env.restore_state(half)  # with late commands, and before what happens once
    assert env.state_hash() == first[6]
    copied = pickle.loads(pickle.dumps(env))
    assert hashes(env, moves[7:], start) == first[7:]
    assert hashes(copied, moves[7:], start) == first[7:]
    env.close()
    copied.close()


@pytest.mark.parametrize("axis", AXES)
def test_one_environment_leaves_nothing_behind_for_another(axis):
    task, moves = task_of(axis), wiggle(3)
    plain, perturbed = make(task), make(task, axis)
    plain.reset(seed=6)
    start = plain.scene.commanded
    expected = hashes(plain, moves[:5], start)
    perturbed.reset(seed=6)
    hashes(perturbed, moves[:5], start)
    plain.reset(seed=6)
    assert hashes(plain, moves[:5], start) == expected
    for env in (plain, perturbed):
        env.close()
