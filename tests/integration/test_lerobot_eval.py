"""LeRobot's own evaluation loop plays several tasks at the same time."""

from collections.abc import Callable
from unittest.mock import MagicMock

import pytest
import torch
from lerobot.envs.factory import make_env
from lerobot.envs.utils import close_envs
from lerobot.policies import PreTrainedPolicy
from lerobot.processor import PolicyProcessorPipeline
from lerobot.scripts.lerobot_eval import eval_policy_all

from lerobot_bimanual.dataset import schema
from lerobot_env_bimanual import BimanualEnvConfig
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv

pytestmark = pytest.mark.slow

SIZE = 24


def scripted_policy(act: Callable[[dict], torch.Tensor]) -> MagicMock:
    """A policy that computes actions from the observation by a function."""
    policy = MagicMock(spec=PreTrainedPolicy, training=False)
    policy.select_action.side_effect = act
    return policy


def observed(policy: MagicMock, key: str) -> torch.Tensor:
    """One entry of all observations that a policy was given."""
    return torch.stack([call.args[0][key] for call in policy.select_action.call_args_list])


def processors() -> dict[str, PolicyProcessorPipeline]:
    """Processors that change nothing."""
    names = ("env_preprocessor", "env_postprocessor", "preprocessor")
    action = PolicyProcessorPipeline(steps=[], to_transition=lambda a: a, to_output=lambda a: a)
    return {name: PolicyProcessorPipeline(steps=[]) for name in names} | {"postprocessor": action}


@pytest.fixture
def at_most_ten_steps(monkeypatch):
    """Let LeRobot cut rollouts early."""
    call = LazyVectorEnv.call

    def short(self, name, *arguments):
        return (10,) * self.num_envs if name == "_max_episode_steps" else call(self, name, *arguments)

    monkeypatch.setattr(LazyVectorEnv, "call", short)


@pytest.mark.parametrize("asynchronous", [False, True])
def test_two_tasks_are_evaluated_at_the_same_time(asynchronous, tmp_path, at_most_ten_steps):
    config = BimanualEnvConfig(task="push_box,lift_ball", image_size=SIZE, max_parallel_tasks=2)
    results = []
    for number in (1, config.max_parallel_tasks):
        envs = make_env(config, n_envs=2, use_async_envs=asynchronous)
        policy = scripted_policy(lambda batch: batch[schema.STATE])
        options = {"videos_dir": tmp_path / str(number), "max_episodes_rendered": 1, "start_seed": 0}
        options |= {"n_episodes": 2, "max_parallel_tasks": number}
        info = eval_policy_all(envs, policy, **processors(), **options)
        close_envs(envs)  # in this thread, while the images were made in others
        images = observed(policy, schema.image_key("front")).flatten(1).sum(1)
        results.append((info["overall"]["n_episodes"], sorted(images.tolist())))
    assert results[0] == results[1]
    assert {path.parent.name for path in (tmp_path / "2").rglob("*.mp4")} == {"push_box_0", "lift_ball_1"}
