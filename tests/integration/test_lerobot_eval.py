"""LeRobot's own evaluation loop drives the environment with joint actions and keyposes."""

import subprocess
import sys
import textwrap
from dataclasses import dataclass

import pytest
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.envs.factory import make_env
from lerobot.envs.utils import close_envs, preprocess_observation
from lerobot.policies import PreTrainedPolicy
from lerobot.processor import PolicyProcessorPipeline
from lerobot.scripts.lerobot_eval import eval_policy, eval_policy_all

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_env_bimanual import BimanualEnvConfig
from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv

pytestmark = pytest.mark.slow

SIZE = 24


@PreTrainedConfig.register_subclass("scripted_for_tests")
@dataclass
class ScriptedConfig(PreTrainedConfig):
    observation_delta_indices = None
    action_delta_indices = None
    reward_delta_indices = None

    def get_optimizer_preset(self):
        raise NotImplementedError

    def get_scheduler_preset(self):
        return None

    def validate_features(self):
        pass


class ScriptedPolicy(PreTrainedPolicy):
    """Computes actions from the observation by a given function and keeps what it was shown."""

    config_class = ScriptedConfig
    name = "scripted_for_tests"

    def __init__(self, act):
        super().__init__(ScriptedConfig(device="cpu"))
        self.act = act
        self.batches = []

    def reset(self):
        pass

    def get_optim_params(self):
        return {}

    def forward(self, batch):
        raise NotImplementedError

    def predict_action_chunk(self, batch, **kwargs):
        raise NotImplementedError

    def select_action(self, batch, **kwargs):
        self.batches.append(batch)
        return self.act(batch)


def hold_joints(batch) -> torch.Tensor:
    return batch[schema.STATE]


def hands_down(batch) -> torch.Tensor:
    """Keyposes: 5 cm lower than now, open, contact motion; later ones are out of the workspace."""
    poses = batch[schema.EE_POSE].reshape(-1, 2, 7).clone()
    poses[..., 2] += torch.where(batch[schema.KEYPOSE_STEP] < 2, -0.05, 2.0)
    flags = torch.ones(*poses.shape[:2], 2)
    return torch.cat([poses, flags], dim=-1).flatten(1)


def identity() -> PolicyProcessorPipeline:
    return PolicyProcessorPipeline(steps=[])


def processors() -> dict:
    action = PolicyProcessorPipeline(steps=[], to_transition=lambda a: a, to_output=lambda a: a)
    return {
        "env_preprocessor": identity(),
        "env_postprocessor": identity(),
        "preprocessor": identity(),
        "postprocessor": action,
    }


def evaluate(act, asynchronous: bool, **options) -> tuple[dict, ScriptedPolicy]:
    config = BimanualEnvConfig(task="lift_ball", image_size=SIZE, **options)
    envs = make_env(config, n_envs=2, use_async_envs=asynchronous)
    policy = ScriptedPolicy(act)
    (env,) = envs["lift_ball"].values()
    info = eval_policy(env, policy, **processors(), n_episodes=2, start_seed=7)
    close_envs(envs)
    return info, policy


@pytest.mark.parametrize("asynchronous", [False, True])
def test_keyposes_pass_through_the_evaluation_loop(asynchronous):
    info, policy = evaluate(hands_down, asynchronous)
    assert [episode["seed"] for episode in info["per_episode"]] == [7, 8]
    assert info["aggregated"]["pc_success"] == 0.0
    steps = torch.stack([batch[schema.KEYPOSE_STEP] for batch in policy.batches]).squeeze(-1)
    assert steps.tolist() == [[0, 0], [1, 1], [2, 2]]
    heights = torch.stack([batch[schema.EE_POSE][:, 2] for batch in policy.batches])
    assert torch.allclose(heights.diff(dim=0), torch.tensor(-0.05), atol=5e-3)


def test_a_policy_sees_the_keys_and_shapes_of_the_dataset():
    envs = make_env(BimanualEnvConfig(task="lift_ball", image_size=SIZE), n_envs=2)
    (env,) = envs["lift_ball"].values()
    observation = preprocess_observation(env.reset(seed=[0, 1])[0])
    close_envs(envs)
    for key, feature in schema.features(CAMERA_NAMES, SIZE, SIZE, "keyframes").items():
        if key == schema.NEXT_KEYPOSE or not key.startswith("observation."):
            continue
        shape = feature["shape"]
        if len(shape) == 3:
            shape = (shape[2], *shape[:2])
        value = observation.pop(key)
        assert value.dtype == torch.float32
        assert value.shape == (2, *shape)
    assert not observation


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
        policy = ScriptedPolicy(hold_joints)
        info = eval_policy_all(
            envs,
            policy,
            **processors(),
            n_episodes=2,
            max_episodes_rendered=1,
            videos_dir=tmp_path / str(number),
            start_seed=0,
            max_parallel_tasks=number,
        )
        close_envs(envs)  # in this thread, while the images were made in others
        results.append(info["overall"]["n_episodes"])
        images = [batch[schema.image_key("front")].sum().item() for batch in policy.batches]
        results.append(sorted(images))
    assert results[:2] == results[2:]
    assert {path.parent.name for path in (tmp_path / "2").rglob("*.mp4")} == {"push_box_0", "lift_ball_1"}


def test_a_policy_that_diverges_ends_its_episodes_and_not_the_evaluation(caplog):
    def diverging(batch) -> torch.Tensor:
        return batch[schema.STATE].index_fill(1, torch.tensor([4]), torch.nan)

    with caplog.at_level("INFO"):
        info, policy = evaluate(diverging, False, obs="state")
    assert info["aggregated"]["pc_success"] == 0.0
    assert len(policy.batches) == 1
    assert "(2 x invalid action: joint action is not finite in)" in caplog.text


def test_workers_load_neither_lerobot_nor_torch():
    # In a process of its own: workers come from the process's one fork server, and other tests start it with more.
    program = textwrap.dedent("""
        import lerobot.envs, torch
        from lerobot_env_bimanual.vector.lazy_vector_env import LazyVectorEnv

        def make_reporting_env():
            import sys
            from lerobot_env_bimanual.env import BimanualEnv
            env = BimanualEnv("lift_ball", obs="state")
            env.loaded = sorted({"lerobot", "torch", "mujoco"} & set(sys.modules))
            return env

        if __name__ == "__main__":
            envs = LazyVectorEnv([make_reporting_env], asynchronous=True)
            print("loaded:", envs.get_attr("loaded"))
            envs.close()
    """)
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert "loaded: (['mujoco'],)" in child.stdout, child.stdout + child.stderr
