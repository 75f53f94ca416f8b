"""An episode is determined bit for bit."""

import copy
import hashlib
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.registry import AXES

TASK = "lift_ball"


def hash_sequence(env: BimanualEnv, seed: int, ticks: int = 5) -> list[str]:
    """The state after the reset and after each tick of a random walk of the arms."""
    env.reset(seed=seed)
    hashes = [env.state_hash()]
    steps = np.random.default_rng(seed).uniform(-0.05, 0.05, (ticks, 16))
    for action in (env.scene.commanded + np.cumsum(steps, axis=0)).astype(np.float32):
        env.step(action)
        hashes.append(env.state_hash())
    return hashes


def perturbed_sequence() -> list[str]:
    """The same with every axis at its highest level, and what is seen at the end."""
    perturb = ",".join(f"{axis}:3" for axis in AXES.names if axis != "stiffness")  # the task has no joints
    env = BimanualEnv(TASK, image_size=16, perturb=perturb)
    hashes, observation = hash_sequence(env, seed=7), env.observe()
    env.close()
    images = [*observation.pop("pixels").values(), *observation.values()]
    return [*hashes, hashlib.sha256(b"".join(image.tobytes() for image in images)).hexdigest()]


def test_same_seed_gives_the_same_bits_in_another_process_and_with_images(state_env, rgbd_env):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); import test_env_lifecycle as t;"
        f"print(*t.hash_sequence(t.BimanualEnv({TASK!r}, obs='state'), seed=7), *t.perturbed_sequence())"
    )
    command = [sys.executable, "-c", script, str(Path(__file__).parent)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    hashes = hash_sequence(state_env, seed=7)
    assert output.split() == [*hashes, *perturbed_sequence()]
    assert hash_sequence(rgbd_env, seed=7) == hashes


def test_a_seed_means_another_episode_in_every_split():
    hashes = set()
    for split in ("train", "val", "test"):
        env = BimanualEnv(TASK, obs="state", split=split)
        hashes.add(hash_sequence(env, seed=5, ticks=0)[0])
        env.close()
    assert len(hashes) == 3


def test_variations_of_a_seed_share_no_layout_and_one_that_is_drawn_is_the_one_that_may_be_asked_for():
    env = BimanualEnv("put_item_in_drawer", obs="state")
    env.reset(seed=5)
    drawn, drawn_hash, cabinets = env.variation, env.state_hash(), []
    for variation in range(3):
        env.reset(seed=5, options={"variation": variation})
        cabinets.append(tuple(env.scene.pose("cabinet").position))
        assert (env.state_hash() == drawn_hash) == (variation == drawn)
    env.close()
    assert len(set(cabinets)) == 3


def test_reset_without_seed_continues_the_generator_of_the_last_seed(state_env):
    def unseeded_episodes() -> list[str]:
        state_env.reset(seed=4)
        return [state_env.state_hash() for _ in range(2) if state_env.reset()]

    episodes = unseeded_episodes()
    assert len(set(episodes)) == 2
    assert unseeded_episodes() == episodes


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_running_environment_is_not_copied_so_that_no_two_share_a_world(duplicate, state_env):
    state_env.reset(seed=0)
    with pytest.raises(TypeError, match=r"save_state\(\)"):
        duplicate(state_env)
