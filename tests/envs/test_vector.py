"""Vector environments: lazy, light, frozen after an episode, and the same bits in every process."""

import subprocess
import sys
from functools import partial

import gymnasium as gym
import numpy as np
import pytest

from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.vector import FreezeWhenOver, LazyVectorEnv

make_lift_ball = partial(BimanualEnv, "lift_ball", image_size=16, cameras=("front",))


class CountingEnv(gym.Env):
    """Ends after three steps; counts what is asked of it."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012
    render_mode = "rgb_array"
    observation_space = gym.spaces.Box(0, 100, (1,), np.float32)
    action_space = gym.spaces.Box(0, 1, (16,), np.float32)

    def __init__(self):
        self.resets = self.steps = self.tick = 0

    def observe(self):
        return np.array([self.tick], dtype=np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.resets += 1
        self.tick = 0
        return self.observe(), {"is_success": False}

    def step(self, action):
        self.steps += 1
        self.tick += 1
        over = self.tick >= 3
        return self.observe(), 1.0, over, False, {"is_success": over}


def test_workers_run_the_main_script_not_again(tmp_path):
    script = tmp_path / "main_script"
    script.write_text(
        "from pathlib import Path\n"
        f"with Path({str(tmp_path / 'runs')!r}).open('a') as runs: runs.write('x')\n"
        "if __name__ == '__main__':\n"
        "    from functools import partial\n"
        "    from lerobot_env_bimanual.env import BimanualEnv\n"
        "    from lerobot_env_bimanual.vector import LazyVectorEnv\n"
        "    envs = LazyVectorEnv([partial(BimanualEnv, 'lift_ball', obs='state')] * 2, asynchronous=True)\n"
        "    print(envs.call('task'))\n"
        "    envs.close()\n"
        "    print(__file__, __spec__)\n"
    )
    output = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True).stdout
    assert output.splitlines() == ["('lift_ball', 'lift_ball')", f"{script} None"]
    assert (tmp_path / "runs").read_text() == "x"


def test_environments_start_at_first_use_and_end_at_close():
    made = []

    def make() -> gym.Env:
        made.append(CountingEnv())
        return made[-1]

    envs = LazyVectorEnv([make, make], asynchronous=False)
    examples = len(made)
    assert examples == 1
    envs.reset(seed=0)
    assert len(made) == examples + 2
    envs.close()
    envs.close()
    observations, _ = envs.reset(seed=0)
    assert observations.shape == (2, 1)
    assert len(made) == examples + 4
    envs.close()


def test_a_finished_environment_is_frozen_until_an_explicit_reset():
    envs = LazyVectorEnv([CountingEnv], asynchronous=False)
    envs.reset(seed=[0])
    actions = np.zeros((1, 16), dtype=np.float32)
    rewards = [envs.step(actions)[1].item() for _ in range(8)]
    assert rewards == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    observations, _, _, _, info = envs.step(actions)
    assert observations.item() == 3
    assert info["is_success"].tolist() == [True]
    assert envs.get_attr("steps") == (3,)
    assert envs.get_attr("resets") == (1,)
    for arguments in ({"options": {"lerobot_new_rollout": True}}, {"seed": [1]}, {}):
        observations, info = envs.reset(**arguments)
        assert observations.item() == 0
        assert info["is_success"].tolist() == [False]
        for _ in range(3):
            envs.step(actions)
    envs.close()


def test_freezing_happens_only_at_the_end():
    env = FreezeWhenOver(CountingEnv())
    env.reset(seed=0)
    env.step(np.zeros(16))
    assert env.reset()[0].item() == 0


@pytest.fixture(scope="module")
def rollouts():
    """The same episodes of 16 and 18 numbers per action, synchronous and asynchronous."""
    return [roll_out(asynchronous) for asynchronous in (False, True)]


def roll_out(asynchronous: bool) -> list:
    envs = LazyVectorEnv([make_lift_ball] * 2, asynchronous=asynchronous)
    record = [envs.reset(seed=[3, 4], options={"lerobot_new_rollout": True})]
    holding = np.stack([observation["agent_pos"] for observation in envs.call("observe")])
    for _ in range(2):
        record.append(envs.step(holding + np.float32(0.01)))
        record.append(envs.call("state_hash"))
    for height_m in (-0.05, 2.0):
        poses = np.stack([observation["ee_pose"] for observation in envs.call("observe")]).reshape(2, 2, 7)
        poses[1, :, 2] += height_m  # the second environment's second motion is out of reach
        flags = np.ones((2, 2, 2), dtype=np.float32)
        record.append(envs.step(np.concatenate([poses, flags], axis=-1).reshape(2, 18)))
        record.append(envs.call("state_hash"))
    record.append(envs.call("task_description"))
    record.append(envs.call("_max_episode_steps"))
    envs.close()
    return record


def assert_same(a, b):
    assert type(a) is type(b)
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for key in a:
            assert_same(a[key], b[key])
    elif isinstance(a, list | tuple):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            assert_same(x, y)
    else:
        np.testing.assert_array_equal(a, b)


def test_asynchronous_environments_do_the_same_as_synchronous_ones(rollouts):
    assert_same(*rollouts)


def test_information_survives_the_merge_of_environments(rollouts):
    _, _, terminated, _, info = next(
        record for record in rollouts[1] if len(record) == 5 and record[4]["failure"][1]
    )
    assert terminated.tolist() == [False, True]
    assert info["is_success"].dtype == bool
    assert info["failure"][0] == ""
    assert "left" in info["failure"][1]
    assert {values.dtype for values in info["conditions"].values()} == {np.dtype(bool)}
