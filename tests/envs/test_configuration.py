"""LeRobot's configuration of the environment."""

from dataclasses import dataclass

import draccus
import pytest
from lerobot.configs import FeatureType
from lerobot.envs.configs import EnvConfig
from lerobot.envs.factory import make_env
from lerobot.envs.utils import env_to_policy_features, preprocess_observation
from lerobot.utils.feature_utils import dataset_to_policy_features

from lerobot_bimanual.cameras import CAMERA_NAMES
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidChoice
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


@pytest.mark.parametrize(
    ("given", "count"),
    [({}, 16), ({"cameras": "left_wrist"}, 8), ({"obs": "rgb"}, 11), ({"obs": "state"}, 6)],
)
def test_the_declared_features_are_what_policies_get_and_what_datasets_hold(given, count, instant_placement):
    config = BimanualEnvConfig(image_size="24x32", **given)
    env = BimanualEnv("push_box", **config.gym_kwargs)
    observation, _ = env.reset(seed=0)
    env.close()
    pixels = {camera: image[None] for camera, image in observation.pop("pixels", {}).items()}
    batch = preprocess_observation(
        {key: value[None] for key, value in observation.items()} | {"pixels": pixels}
    )
    features = env_to_policy_features(config)
    action = features.pop(schema.ACTION)
    assert (action.type, len(features)) == (FeatureType.ACTION, count)
    assert {key: feature.shape for key, feature in features.items()} == {
        key: tuple(value.shape[1:]) for key, value in batch.items()
    }
    stored = dataset_to_policy_features(schema.features(CAMERA_NAMES, 24, 32, "frames"))
    assert features == {key: stored[key] for key in features}


@pytest.mark.parametrize(("mode", "length"), [("auto", 16), ("joint", 16), ("keypose", 18)])
def test_the_declared_action_follows_the_control_mode(mode, length):
    config = BimanualEnvConfig(control_mode=mode)
    assert config.features[schema.ACTION].shape == (length,)
    assert BimanualEnv("push_box", **config.gym_kwargs).action_space.shape == (length,)


def test_environments_are_grouped_by_suite_and_a_task_alone_is_a_group():
    suites = list_suites()
    alone = next(task for task in suites["all"] if task not in suites["symmetric"])
    envs = make_env(parse(f"--env.task={alone}, symmetric"), n_envs=2)
    groups = {alone: (alone,), "symmetric": suites["symmetric"]}
    assert {group: list(by_id) for group, by_id in envs.items()} == {
        group: [get_task(task).spec.id for task in tasks] for group, tasks in groups.items()
    }
    for group, by_id in envs.items():
        assert [env.call("task") for env in by_id.values()] == [(task, task) for task in groups[group]]


def test_bad_options_are_refused_with_the_valid_ones():
    with pytest.raises(InvalidChoice, match="symmetric"):
        BimanualEnvConfig(task="symetric")
    with pytest.raises(InvalidChoice, match=r"share no task, .*push_box"):
        BimanualEnvConfig(task="push_box,all")
    with pytest.raises(InvalidChoice, match="20"):
        BimanualEnvConfig(fps=30)
