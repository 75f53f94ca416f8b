"""LeRobot's configuration of the environment."""

from dataclasses import dataclass

import draccus
import pytest
from lerobot.configs import FeatureType
from lerobot.envs.configs import EnvConfig
from lerobot.envs.factory import make_env
from lerobot.envs.utils import env_to_policy_features

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidChoice, UnknownTask
from lerobot_env_bimanual import BimanualEnvConfig
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.tasks.registry import get_task, list_suites


@dataclass
class CommandLine:
    env: EnvConfig


def parse(*arguments: str) -> EnvConfig:
    return draccus.parse(CommandLine, args=["--env.type=bimanual", *arguments]).env


def test_flags_reach_the_environment():
    given = {
        "variation": 0,
        "split": "val",
        "cameras": "front,left_wrist",
        "image_size": "24x32",
        "obs": "rgb",
        "control_mode": "joint",
        "video_dir": "films",
        "max_keyposes": 7,
    }
    config = parse("--env.task=lift_ball", *(f"--env.{name}={value}" for name, value in given.items()))
    options = BimanualEnv("lift_ball", **config.gym_kwargs).options
    assert {name: getattr(options, name) for name in given} == given
    assert (options.camera_names, options.size) == (("front", "left_wrist"), (24, 32))


def test_policies_see_the_names_and_shapes_of_the_dataset():
    features = env_to_policy_features(BimanualEnvConfig(image_size="24x32"))
    dataset = schema.features(CAMERA_NAMES, 24, 32, "frames")
    assert set(features) == {schema.ACTION, schema.STATE, *map(schema.image_key, CAMERA_NAMES)}
    for key, feature in features.items():
        shape = dataset[key]["shape"]
        if feature.type is FeatureType.VISUAL:
            shape = (shape[2], *shape[:2])
        assert feature.shape == shape
    assert features[schema.ACTION].type is FeatureType.ACTION
    assert features[schema.STATE].type is FeatureType.STATE


@pytest.mark.parametrize(("mode", "length"), [("auto", 16), ("joint", 16), ("keypose", 18)])
def test_the_declared_action_follows_the_control_mode(mode, length):
    config = BimanualEnvConfig(control_mode=mode)
    assert config.features[schema.ACTION].shape == (length,)
    assert BimanualEnv("push_box", **config.gym_kwargs).action_space.shape == (length,)


def test_environments_are_grouped_by_task():
    envs = make_env(parse("--env.task=push_box,symmetric"), n_envs=2)
    expected = dict.fromkeys(("push_box", *list_suites()["symmetric"]))
    assert list(envs) == list(expected)
    for task, by_id in envs.items():
        ((task_id, env),) = by_id.items()
        assert task_id == get_task(task).spec.id
        assert env.num_envs == 2
        assert env.call("task") == (task, task)


def test_bad_options_are_refused_with_the_valid_ones():
    with pytest.raises(UnknownTask, match="symmetric"):
        BimanualEnvConfig(task="symetric")
    with pytest.raises(InvalidChoice, match="20"):
        BimanualEnvConfig(fps=30)
