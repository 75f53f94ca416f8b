"""Resets with bad arguments, copies of running environments, episodes ended from outside."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest

from lerobot_bimanual.errors import BimanualError, InvalidChoice
from lerobot_env_bimanual.env import BimanualEnv

TASK = "lift_ball"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"seed": 0.5}, "seed is 0.5"),
        ({"seed": -1}, "seed is -1"),
        ({"options": [("variation", 1)]}, "a mapping such as"),
        ({"options": {"variaton": 1}}, "an option of reset is 'variaton', but must be one of: variation"),
    ],
)
def test_bad_arguments_of_reset_leave_the_episode_as_it_is(arguments, complaint, state_env):
    state_env.reset(seed=2)
    before = state_env.state_hash()
    with pytest.raises(InvalidChoice, match=complaint):
        state_env.reset(**{"seed": 3} | arguments)
    assert state_env.state_hash() == before
    assert state_env.progress.seed == 2


@pytest.mark.parametrize("duplicate", [copy.deepcopy, copy.copy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_of_an_environment_goes_on_by_itself(duplicate, state_env):
    state_env.reset(seed=3)
    state_env.step(state_env.scene.commanded)
    other = duplicate(state_env)
    for env in (state_env, other):
        for _ in range(3):
            env.step(env.scene.commanded + np.float32(0.05))
    assert other.state_hash() == state_env.state_hash()
    state_env.step(state_env.scene.commanded)
    assert other.progress.ticks == state_env.progress.ticks - 1
    assert other.np_random.integers(2**31) == state_env.np_random.integers(2**31)
    other.close()


def test_an_episode_that_is_filmed_has_no_copy(tmp_path):
    env = BimanualEnv(TASK, obs="state", video_dir=tmp_path)
    env.reset(seed=0)
    copy.deepcopy(env)
    env.step(env.scene.commanded)
    with pytest.raises(BimanualError, match="cannot be copied"):
        copy.deepcopy(env)
    env.close()


def test_a_caller_may_end_an_episode_as_a_failure(state_env):
    state_env.reset(seed=0)
    before = state_env.state_hash()
    _, reward, terminated, truncated, info = state_env.fail("the operator gave up")
    assert (reward, terminated, truncated, info["failure"]) == (0.0, True, False, "the operator gave up")
    assert state_env.state_hash() == before
    with pytest.raises(gym.error.ResetNeeded):
        state_env.fail("again")
