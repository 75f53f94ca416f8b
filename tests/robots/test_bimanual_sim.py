"""The simulated arms as a LeRobot robot."""

from collections.abc import Callable
from unittest.mock import Mock

import numpy as np
import pytest
from lerobot.utils.errors import DeviceNotConnectedError
from lerobot.utils.feature_utils import build_dataset_frame, hw_to_dataset_features

from lerobot_bimanual.dataset import feature_table, schema
from lerobot_bimanual.errors import BimanualError, InvalidAction, PlacementFailure
from lerobot_env_bimanual.env import BimanualEnv
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_env_bimanual.worlds import EpisodeReset
from lerobot_robot_bimanual.bimanual_sim import AWAY_RAD, BimanualSim
from lerobot_robot_bimanual.config_bimanual_sim import BimanualSimConfig


@pytest.fixture
def make_robot(tmp_path) -> Callable[..., BimanualSim]:
    """Makes robots without cameras, connected by default; LeRobot disconnects what is forgotten."""

    def make(connected: bool = True, **options) -> BimanualSim:
        robot = BimanualSim(BimanualSimConfig(**{"obs": "state", "calibration_dir": tmp_path} | options))
        if connected:
            robot.connect()
        return robot

    return make


def action(values) -> dict[str, float]:
    return dict(zip(schema.JOINT_NAMES, values, strict=True))


def home(offset_rad: float = 0.0) -> dict[str, float]:
    """Home, with one joint off by so much."""
    at_home = action([*PANDA_PAIR.home_joints.tolist(), 1.0] * 2)
    at_home["right_joint1.pos"] += offset_rad
    return at_home


def test_features_match_our_datasets_and_observations_match_the_environment(make_robot):
    options = {"obs": "rgbd", "cameras": "front,left_wrist", "image_size": "24x32"}
    robot = make_robot(**options, seed=5)
    ours = feature_table.features(("front", "left_wrist"), 24, 32, "frames")
    theirs = hw_to_dataset_features(robot.observation_features, "observation")
    theirs |= hw_to_dataset_features(robot.action_features, "action")
    for key, feature in theirs.items():
        for part in ("dtype", "shape", "names"):
            assert feature[part] == ours[key][part], key
        is_depth = ours[key].get("info", {}).get("is_depth_map", False)
        assert feature.get("info", {}).get("is_depth_map", False) == is_depth
    frame = build_dataset_frame(theirs, robot.get_observation(), "observation")
    assert {key: value.shape for key, value in frame.items()} == {
        key: feature["shape"] for key, feature in theirs.items() if key != schema.ACTION
    }
    assert frame[schema.depth_key("front")].dtype == np.uint16
    assert robot.robot_type == schema.ROBOT_TYPE
    env = BimanualEnv("push_box", split="train", **options)
    expected, _ = env.reset(seed=5)
    observed = robot.get_observation()
    assert [observed[name] for name in schema.JOINT_NAMES] == expected["agent_pos"].tolist()
    assert np.array_equal(observed["front"], expected["pixels"]["front"])
    difference_mm = observed["front_depth"][..., 0] - expected["images.front_depth"][0]
    assert np.abs(difference_mm).max() <= 0.5


def test_an_episode_that_cannot_begin_leaves_no_robot_connected(make_robot, monkeypatch):
    monkeypatch.setattr(EpisodeReset, "start", Mock(side_effect=PlacementFailure("nowhere")))
    robot = make_robot(connected=False)
    with pytest.raises(PlacementFailure):
        robot.connect()
    assert not robot.is_connected
    with pytest.raises(DeviceNotConnectedError):
        robot.get_observation()


@pytest.mark.parametrize("tolerance_rad", [0.001, 0.04])
def test_sending_both_hands_home_begins_the_next_episode(make_robot, tolerance_rad):
    robot = make_robot(seed=7, variation=0, home_tolerance_rad=tolerance_rad)
    beginning = robot.env.state_hash()
    for offset_rad in (0.0, AWAY_RAD / 2, 0.0):  # never away
        robot.send_action(home(offset_rad))
    assert (robot.env.progress.seed, robot.env.progress.ticks) == (7, 3)
    for offset_rad in (2 * AWAY_RAD, 1.1 * tolerance_rad):  # not yet back
        robot.send_action(home(offset_rad))
    assert (robot.env.progress.seed, robot.env.progress.ticks) == (7, 5)
    robot.send_action(home(0.9 * tolerance_rad))
    assert (robot.env.progress.seed, robot.env.progress.ticks) == (8, 0)
    robot.disconnect()
    robot.connect()
    assert robot.env.state_hash() == beginning


def test_returning_the_arms_to_a_perturbed_start_posture_begins_the_next_episode(make_robot):
    robot = make_robot(seed=7, perturb="start_posture:1")
    found = {name: value for name, value in robot.get_observation().items() if name.endswith(".pos")}
    for sent in (home(4 * AWAY_RAD), found):
        robot.send_action(sent)
    assert (robot.env.progress.seed, robot.env.progress.ticks) == (8, 0)


def test_an_episode_that_is_over_does_not_change_and_time_alone_ends_no_episode(make_robot):
    robot = make_robot()
    robot.env.progress.ticks = 10 * robot.env.task_definition.spec.horizon_ticks
    before = robot.env.state_hash()
    robot.send_action(home(0.2))
    assert robot.env.state_hash() != before
    robot.env.fail("it is enough")
    before = robot.env.state_hash()
    robot.send_action(home(0.2))
    assert robot.env.state_hash() == before
    robot.send_action(home())
    assert robot.env.progress.seed == 1


def test_an_episode_that_cannot_begin_is_passed_over_when_hands_are_sent_home_again(make_robot, monkeypatch):
    robot = make_robot()
    robot.send_action(home(2 * AWAY_RAD))
    with monkeypatch.context() as patch:
        patch.setattr(EpisodeReset, "start", Mock(side_effect=PlacementFailure("nowhere")))
        with pytest.raises(PlacementFailure):
            robot.send_action(home())
    robot.send_action(home())
    assert (robot.env.progress.seed, robot.env.progress.failure) == (2, "")


def test_a_condition_met_on_the_way_is_not_logged_as_unmet(make_robot, caplog):
    robot = make_robot(task="handover_item")
    robot.send_action(home())
    history_conditions = robot.env.progress.history_conditions
    assert [*history_conditions.values()] == [False]
    robot.env.progress.history_conditions = dict.fromkeys(history_conditions, True)
    with caplog.at_level("INFO", "lerobot_robot_bimanual"):
        robot.env.log_outcome()
    assert "unmet: " in caplog.text
    assert not any(name in caplog.text for name in history_conditions)


def test_a_target_outside_the_limits_is_approached_at_the_largest_speed_and_what_was_sent_is_told(make_robot):
    robot = make_robot()
    for _ in range(200):
        sent = robot.send_action(home() | {"left_joint1.pos": 9.0, "right_gripper.pos": -1.0})
        assert [*sent.values()] == robot.env.progress.sent_action.tolist()
        if robot.env.progress.ticks == 1:
            assert 0 < sent["left_joint1.pos"] < 0.1
    assert sent["left_joint1.pos"] == pytest.approx(PANDA_PAIR.joint_upper[0])
    assert sent["right_gripper.pos"] == 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"elbow": 1.0}, "unknown: elbow"),
        ({"left_joint1.pos": None}, "consists of numbers"),
        ({"left_joint1.pos": float("nan")}, r"not finite in: left_joint1\.pos"),
    ],
)
def test_a_wrong_action_is_refused_and_changes_nothing(make_robot, change, message):
    robot = make_robot()
    before = robot.env.state_hash()
    with pytest.raises(InvalidAction, match=message):
        robot.send_action(home() | change)
    assert robot.env.state_hash() == before


def test_an_option_outside_its_choices_is_refused_with_the_choices():
    wrong = [
        ("task", "push_bocks", "push_box"),
        *(("seed", seed, r"2\*\*63") for seed in (-1, None)),
        ("perturb", "earthquake:1", "mass"),
        ("control_mode", "keypose", "auto, joint"),
        *(("home_tolerance_rad", value, "above 0, at most 0.05") for value in (0.0, 0.06, float("nan"))),
    ]
    for option, value, choice in wrong:
        with pytest.raises(BimanualError, match=choice):
            BimanualSimConfig(**{option: value})
