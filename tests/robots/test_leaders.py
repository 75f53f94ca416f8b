"""Both hands of the leader arms are moved by the keys of a terminal."""

import sys
from pathlib import Path

import numpy as np
import pytest
from lerobot.common.control_utils import teleop_supports_feedback
from lerobot.teleoperators.utils import make_teleoperator_from_config
from lerobot.utils.errors import DeviceNotConnectedError
from lerobot.utils.keyboard_input import init_keyboard_listener

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_robot_bimanual import leaders
from lerobot_robot_bimanual.config_leaders import BimanualKeyboardConfig
from lerobot_robot_bimanual.leaders import WRITTEN, BimanualKeyboard, NoTerminal, TerminalKeys


class Script:
    """Keys that were written down beforehand, in place of a terminal."""

    def __init__(self):
        self.keys = ""

    def struck(self) -> list[str]:
        keys, self.keys = [*self.keys], ""
        return keys

    def stop(self) -> None:
        pass


@pytest.fixture
def script(monkeypatch) -> Script:
    script = Script()
    monkeypatch.setattr(leaders, "TerminalKeys", lambda names: script)
    return script


def poses(leader: BimanualKeyboard) -> dict:
    joints = np.array([*leader.get_action().values()]).reshape(2, 8)[:, :7]
    return {arm: PANDA_PAIR.kinematics[arm].pose(joints[arm.ordinal]) for arm in ARMS}


@pytest.fixture
def keyboard_leader(script, tmp_path) -> BimanualKeyboard:
    """Connected, its hands 20 cm below home; a key is 2 cm or 10 degrees."""
    config = BimanualKeyboardConfig(calibration_dir=tmp_path, step_m=0.02, step_deg=10.0)
    leader = BimanualKeyboard(config)
    leader.connect()
    script.keys = "3" + "c" * 10
    leader.get_action()
    return leader


def strike(leader: BimanualKeyboard, script: Script, keys: str) -> dict:
    """The hands' poses after some keys."""
    script.keys = keys
    return poses(leader)


def assert_moved(before: dict, after: dict, hands: tuple[Arm, ...], offset_m, turn_rad) -> None:
    """Those hands have moved and turned by so much, the others not at all."""
    for arm in ARMS:
        expected_m, expected_rad = (np.array(way) * (arm in hands) for way in (offset_m, turn_rad))
        assert np.allclose(after[arm].position - before[arm].position, expected_m, atol=1e-4)
        turned = after[arm].rotation @ before[arm].rotation.T
        axis_sines = np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        assert np.allclose(axis_sines / 2, np.sin(expected_rad), atol=1e-4)


@pytest.mark.parametrize("key", [*leaders.MOVES, *leaders.TURNS])
@pytest.mark.parametrize("choice", leaders.HANDS)
def test_a_key_moves_or_turns_the_chosen_hands_by_a_step(keyboard_leader, script, choice, key):
    before = poses(keyboard_leader)
    after = strike(keyboard_leader, script, choice + key)
    offset_m = 0.02 * np.array(leaders.MOVES.get(key, (0, 0, 0)))
    turn_rad = np.deg2rad(10) * np.array(leaders.TURNS.get(key, (0, 0, 0)))
    assert_moved(before, after, leaders.HANDS[choice], offset_m, turn_rad)


def test_keys_switch_grippers_and_send_both_hands_home(keyboard_leader, script):
    openings = []
    for keys in ("1", "f", "f", "2f", "3f"):
        strike(keyboard_leader, script, keys)
        action = keyboard_leader.get_action()
        openings.append((action["left_gripper.pos"], action["right_gripper.pos"]))
    assert openings == [(1, 1), (0, 1), (1, 1), (1, 0), (0, 1)]
    strike(keyboard_leader, script, "3wwwaaaf2iih")
    assert np.allclose([*keyboard_leader.get_action().values()], [*PANDA_PAIR.home_joints, 1.0] * 2)


def test_an_arm_goes_as_far_as_it_reaches_and_says_so_once(keyboard_leader, script, capsys):
    start = poses(keyboard_leader)
    far = strike(keyboard_leader, script, "1" + "a" * 100)
    assert far[Arm.LEFT].position[1] - start[Arm.LEFT].position[1] > 0.4
    assert capsys.readouterr().err.count("left arm cannot go there") == 1
    strike(keyboard_leader, script, "dd" + "a" * 25)
    assert capsys.readouterr().err.count("left arm cannot go there") == 1


def test_the_leader_arms_go_where_the_robot_is_whatever_is_struck_meanwhile(keyboard_leader, script):
    assert teleop_supports_feedback(keyboard_leader)
    elsewhere = keyboard_leader.get_action()
    strike(keyboard_leader, script, "3ccww2dd")
    script.keys = "3wf"
    keyboard_leader.send_feedback(elsewhere)
    assert keyboard_leader.get_action() == elsewhere
    keyboard_leader.send_feedback({"left_joint1.pos": 100.0})  # of a policy that has gone astray
    limited = keyboard_leader.get_action()
    assert limited == elsewhere | {"left_joint1.pos": limited["left_joint1.pos"]}
    assert limited["left_joint1.pos"] < PANDA_PAIR.joint_upper[0]


def test_lerobot_makes_it_from_its_config(script, tmp_path):
    leader = make_teleoperator_from_config(BimanualKeyboardConfig(calibration_dir=tmp_path))
    assert tuple(leader.action_features) == schema.JOINT_NAMES
    leader.connect()
    assert tuple(leader.get_action()) == schema.JOINT_NAMES
    leader.disconnect()
    with pytest.raises(DeviceNotConnectedError):
        leader.get_action()


def test_keys_are_shared_with_lerobots_controls_and_without_a_terminal_there_are_none(
    keyboard, soon, monkeypatch
):
    assert not set(leaders.KEYS) & {"n", "r", "q", *WRITTEN}
    assert len(leaders.KEYS) == len(set(leaders.KEYS))
    assert set(leaders.KEYS) <= set(leaders.KEYBOARD_HELP.replace("(", " ").split())
    terminal = sys.stdin
    keys = TerminalKeys(("w", "h"))
    listener, events = init_keyboard_listener()
    try:
        keyboard("wxhn")
        assert soon(lambda: events["exit_early"])
        keyboard(WRITTEN["left"])
        assert soon(lambda: events["rerecord_episode"])
        assert keys.struck() == ["w", "h"]
        assert keys.struck() == []
    finally:
        keys.stop()
        listener.stop()
    assert sys.stdin is terminal
    with Path("/dev/null").open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with pytest.raises(NoTerminal, match="without a pipe"):
            TerminalKeys(leaders.KEYS)


@pytest.mark.parametrize(("option", "value"), [("step_m", 1.0), ("step_deg", float("nan"))])
def test_what_no_servo_should_be_sent_is_refused(option, value):
    with pytest.raises(InvalidChoice, match=option):
        BimanualKeyboardConfig(**{option: value})
