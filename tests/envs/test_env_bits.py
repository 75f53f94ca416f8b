"""An episode is determined by task, split, seed and variation, bit for bit."""

import subprocess
import sys
from pathlib import Path

import numpy as np

from lerobot_env_bimanual.env import BimanualEnv

TASK = "lift_ball"


def wiggle(env: BimanualEnv, seed: int, ticks: int) -> list[np.ndarray]:
    """Joint actions of a random walk that starts where the arms stand."""
    rng = np.random.default_rng(seed)
    steps = rng.uniform(-0.05, 0.05, (ticks, 16))
    return list((env.scene.commanded + np.cumsum(steps, axis=0)).astype(np.float32))


def hash_sequence(env: BimanualEnv, seed: int, ticks: int = 5) -> list[str]:
    env.reset(seed=seed)
    hashes = [env.state_hash()]
    for action in wiggle(env, seed, ticks):
        env.step(action)
        hashes.append(env.state_hash())
    return hashes


def test_same_seed_gives_the_same_bits_in_another_process(state_env):
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); import test_env_bits as t;"
        f"print(*t.hash_sequence(t.BimanualEnv({TASK!r}, obs='state'), seed=7))"
    )
    command = [sys.executable, "-c", script, str(Path(__file__).parent)]
    output = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert output.split() == hash_sequence(state_env, seed=7)


def test_observing_does_not_change_the_simulation(state_env, rgbd_env):
    assert hash_sequence(rgbd_env, seed=3) == hash_sequence(state_env, seed=3)


def test_a_seed_means_another_episode_in_every_split():
    hashes = set()
    for split in ("train", "val", "test"):
        env = BimanualEnv(TASK, obs="state", split=split)
        env.reset(seed=5)
        hashes.add(env.state_hash())
        env.close()
    assert len(hashes) == 3


def test_reset_without_seed_continues_the_generator_of_the_last_seed(state_env):
    def unseeded_episodes() -> list[str]:
        state_env.reset(seed=4)
        hashes = []
        for _ in range(2):
            state_env.reset()
            hashes.append(state_env.state_hash())
        return hashes

    episodes = unseeded_episodes()
    assert len(set(episodes)) == 2
    assert unseeded_episodes() == episodes
