"""Policies act under every perturbation of what is seen and said, whether depth comes from the environment or from a dataset."""

import logging

import pytest
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.envs.utils import preprocess_observation
from lerobot.policies.factory import get_policy_class

import lerobot_policy_bimanual  # noqa: F401  (registers its policies)
from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.registry import AXES

pytestmark = pytest.mark.slow

SEEN = tuple(name for name in AXES.names if AXES.get(name).changes_only_observations)
MAX_WARNINGS = 2 * len(CAMERA_NAMES) + 1


def two_batches(perturb: str) -> list[dict]:
    env = BimanualEnv("lift_ball", image_size=32, perturb=perturb)
    batches = []
    for seed in (0, 1):
        observation, _ = env.reset(seed=seed)
        batch = {key: value[None] for key, value in observation.items() if key != "pixels"}
        batch["pixels"] = {camera: rgb[None] for camera, rgb in observation["pixels"].items()}
        batches.append(preprocess_observation(batch) | {"task": [env.task_description]})
    env.close()
    return batches


@pytest.fixture(scope="module")
def conditions() -> dict[str, list[dict]]:
    return {axis: two_batches(f"{axis}:3") for axis in SEEN}


@pytest.mark.parametrize("policy_type", ["peract2", "peract_independent", "peract_lf", "rvt_lf"])
def test_every_policy_acts_under_every_condition_and_warns_once_at_most(
    policy_type, conditions, tiny_flags, caplog
):
    flags = dict(flag.removeprefix("--policy.").split("=") for flag in tiny_flags[policy_type])
    options = {name: int(value) for name, value in flags.items() if name != "type"}
    config = PreTrainedConfig.get_choice_class(policy_type)(device="cpu", keypose_horizon=25, **options)
    policy = get_policy_class(policy_type)(config)
    for condition, batches in conditions.items():
        for batch in batches:
            action = policy.select_action(batch)
            assert torch.isfinite(action).all(), condition
            for key in map(schema.depth_key, CAMERA_NAMES):
                stored = schema.stored_depth(batch[key].numpy())
                batch = batch | {key: torch.from_numpy(stored.astype("float32"))}
                assert ((batch[key] <= schema.UNMEASURED_MM) == (stored == 10)).all()
            assert torch.isfinite(policy.select_action(batch)).all(), f"{condition}, from a dataset"
            policy.reset()
    warnings = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert len(warnings) == len(set(warnings)) <= MAX_WARNINGS
