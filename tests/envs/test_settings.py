"""The setting `varied`: several sets of props, of which each episode has one."""

import pickle

import pytest

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.props.ball import Ball


@pytest.fixture
def env():
    return BimanualEnv("lift_ball", obs="state", split="val", setting="varied")


def _two_seeds(env):
    """Seeds whose episodes have different things."""
    sets = {}
    for seed in range(20):
        env.reset(seed=seed)
        sets.setdefault(env.progress.prop_set, seed)
    return list(sets.values())[:2]


def test_episodes_differ_in_the_size_of_their_things(env):
    radii = set()
    for seed in _two_seeds(env):
        env.reset(seed=seed)
        radii.add(env.scene.prop(Ball, "ball").radius_m)
        assert env.scene.pose("ball").position[2] > 0.75 + env.scene.prop(Ball, "ball").radius_m
    assert len(radii) == 2
    with pytest.raises(KeyError, match="no Ball called 'bottle'"):
        env.scene.prop(Ball, "bottle")


def test_an_episode_goes_on_bit_for_bit_after_one_with_other_things(env):
    first, second = _two_seeds(env)
    env.reset(seed=first)
    action = env.scene.commanded
    action[0] += 0.05
    env.step(action)
    saved, hashed = env.save_state(), env.state_hash()
    env.step(action)
    then = env.state_hash()
    env.reset(seed=second)
    other = BimanualEnv(env.task, options=env.options)
    for each, state in ((env, saved), (other, pickle.loads(pickle.dumps(saved)))):
        each.restore_state(state)
        assert each.state_hash() == hashed
        each.step(action)
        assert each.state_hash() == then
