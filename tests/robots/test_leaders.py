"""Both hands of the leader arms are moved by the keys of a terminal, or at once by the sticks of a gamepad."""

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from lerobot.common.control_utils import teleop_supports_feedback
from lerobot.teleoperators.utils import make_teleoperator_from_config
from lerobot.utils.errors import DeviceNotConnectedError
from lerobot.utils.keyboard_input import init_keyboard_listener

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_robot_bimanual import leaders
from lerobot_robot_bimanual.config_leaders import BimanualGamepadConfig, BimanualKeyboardConfig
from lerobot_robot_bimanual.gamepad import FULL, NoGamepad
from lerobot_robot_bimanual.leaders import BimanualGamepad, BimanualKeyboard, Leader
from lerobot_robot_bimanual.terminal_keys import WRITTEN, NoTerminal, TerminalKeys


class Script:
    """Keys that were written down beforehand, in place of a terminal."""

    def __init__(self):
        self.keys = ""

    def struck(self) -> list[str]:
        keys, self.keys = [*self.keys], ""
        return keys

    def stop(self) -> None:
        pass


class Pad:
    """A gamepad as SDL shows it.

    Attributes:
        held: values of axes and buttons by name; what is missing is at rest.
        is_there: whether it is connected.
    """

    name = "pad of a test"

    def __init__(self):
        self.held: dict[str, float] = {}
        self.is_there = self.is_open = True
        self.attached = lambda: self.is_there
        self.get_axis = lambda name: int(self.held.get(name, 0.0) * FULL)
        self.get_button = lambda name: bool(self.held.get(name, False))

    def quit(self) -> None:
        self.is_open = False


@pytest.fixture
def script(monkeypatch) -> Script:
    script = Script()
    monkeypatch.setattr(leaders, "TerminalKeys", lambda names: script)
    return script


@pytest.fixture
def pad(monkeypatch) -> Pad:
    """The second device, after one that is no gamepad, in a pygame of ours."""
    pad, pygame, sdl = Pad(), ModuleType("pygame"), ModuleType("pygame._sdl2.controller")
    # A constant such as CONTROLLER_AXIS_LEFTX is its own name.
    pygame.__getattr__ = lambda constant: constant.split("_", 2)[2]
    vars(sdl).update(
        dict.fromkeys(("init", "quit", "update"), lambda: None),
        get_count=lambda: 2 * pad.is_there,
        is_controller=lambda index: index == 1,
        Controller=lambda index: {1: pad}[index],
    )
    for module in (pygame, ModuleType("pygame._sdl2"), sdl):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return pad


def poses(leader: Leader) -> dict:
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


@pytest.fixture
def gamepad_leader(pad, tmp_path) -> BimanualGamepad:
    """Connected, its hands 20 cm below home."""
    leader = BimanualGamepad(BimanualGamepadConfig(calibration_dir=tmp_path))
    leader.connect()
    hold(leader, pad, 20, LEFTSHOULDER=1, LEFTY=1.0, RIGHTSHOULDER=1, RIGHTY=1.0)
    return leader


def strike(leader: BimanualKeyboard, script: Script, keys: str) -> dict:
    """The hands' poses after some keys."""
    script.keys = keys
    return poses(leader)


def hold(leader: BimanualGamepad, pad: Pad, ticks: int = 1, **held: float) -> dict:
    """The hands' poses after holding the pad for some ticks and letting it go."""
    pad.held = dict(held)
    for _ in range(ticks):
        leader.get_action()
    pad.held = {}
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


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize(
    ("modifier", "axis", "value", "offset", "turn"),
    [
        ("", "Y", -1.0, (1, 0, 0), (0, 0, 0)),
        ("", "X", -1.0, (0, 1, 0), (0, 0, 0)),
        ("{side}SHOULDER", "Y", -1.0, (0, 0, 1), (0, 0, 0)),
        ("{side}SHOULDER", "X", -1.0, (0, 0, 0), (0, 0, 1)),
        ("TRIGGER{side}", "Y", -1.0, (0, 0, 0), (0, 1, 0)),
        ("TRIGGER{side}", "X", 1.0, (0, 0, 0), (1, 0, 0)),
    ],
)
def test_a_stick_moves_and_turns_its_own_hand(gamepad_leader, pad, arm, modifier, axis, value, offset, turn):
    side = arm.value.upper()
    held = {f"{side}{axis}": value} | ({modifier.format(side=side): 1.0} if modifier else {})
    before, after = poses(gamepad_leader), hold(gamepad_leader, pad, 3, **held)
    offset_m, turn_rad = (
        np.array(offset) * 0.2 * 3 / CONTROL_HZ,
        np.array(turn) * np.deg2rad(60) * 3 / CONTROL_HZ,
    )
    assert_moved(before, after, (arm,), offset_m, turn_rad)


def test_keys_switch_grippers_and_send_both_hands_home(keyboard_leader, script):
    openings = []
    for keys in ("1", "f", "f", "2f", "3f"):
        strike(keyboard_leader, script, keys)
        action = keyboard_leader.get_action()
        openings.append((action["left_gripper.pos"], action["right_gripper.pos"]))
    assert openings == [(1, 1), (0, 1), (1, 1), (1, 0), (0, 1)]
    strike(keyboard_leader, script, "3wwwaaaf2iih")
    assert np.allclose([*keyboard_leader.get_action().values()], [*PANDA_PAIR.home_joints, 1.0] * 2)


def test_a_pressed_stick_switches_its_gripper_once_and_start_sends_both_hands_home(gamepad_leader, pad):
    for right_opening in (0.0, 1.0, 0.0):
        hold(gamepad_leader, pad, 5, RIGHTSTICK=1)
        action = gamepad_leader.get_action()
        assert (action["left_gripper.pos"], action["right_gripper.pos"]) == (1.0, right_opening)
    hold(gamepad_leader, pad, START=1, LEFTY=-1.0)
    assert np.allclose([*gamepad_leader.get_action().values()], [*PANDA_PAIR.home_joints, 1.0] * 2)


def test_a_stick_begins_at_no_speed_beyond_its_dead_zone(gamepad_leader, pad):
    start = gamepad_leader.get_action(), poses(gamepad_leader)
    hold(gamepad_leader, pad, LEFTX=0.14, RIGHTY=-0.14)
    assert gamepad_leader.get_action() == start[0]
    slow = hold(gamepad_leader, pad, LEFTY=-0.2)
    assert 0 < slow[Arm.LEFT].position[0] - start[1][Arm.LEFT].position[0] < 0.001


def test_an_arm_goes_as_far_as_it_reaches_and_says_so_once(gamepad_leader, pad, capsys):
    start = poses(gamepad_leader)
    far = hold(gamepad_leader, pad, 200, LEFTX=-1.0)
    assert far[Arm.LEFT].position[1] - start[Arm.LEFT].position[1] > 0.4
    assert capsys.readouterr().err.count("left arm cannot go there") == 1
    hold(gamepad_leader, pad, 5, LEFTX=1.0)
    hold(gamepad_leader, pad, 50, LEFTX=-1.0)
    assert capsys.readouterr().err.count("left arm cannot go there") == 1


def test_the_leader_arms_go_where_the_robot_is_whatever_is_held_meanwhile(
    keyboard_leader, gamepad_leader, script, pad
):
    for leader in (keyboard_leader, gamepad_leader):
        assert teleop_supports_feedback(leader)
        elsewhere = leader.get_action()
        if leader is keyboard_leader:
            strike(leader, script, "3ccww2dd")
            script.keys = "3wf"
        else:
            hold(leader, pad, 10, LEFTY=-1.0)
            pad.held = {"LEFTSTICK": 1}
        leader.send_feedback(elsewhere)
        assert leader.get_action() == elsewhere
        leader.send_feedback({"left_joint1.pos": 100.0})  # of a policy that has gone astray
        limited = leader.get_action()
        assert limited == elsewhere | {"left_joint1.pos": limited["left_joint1.pos"]}
        assert limited["left_joint1.pos"] < PANDA_PAIR.joint_upper[0]


@pytest.mark.parametrize("config", [BimanualKeyboardConfig, BimanualGamepadConfig])
def test_lerobot_makes_it_from_its_config(script, pad, config, tmp_path):
    leader = make_teleoperator_from_config(config(calibration_dir=tmp_path))
    assert tuple(leader.action_features) == schema.JOINT_NAMES
    leader.connect()
    assert tuple(leader.get_action()) == schema.JOINT_NAMES
    leader.disconnect()
    assert pad.is_open == (config is BimanualKeyboardConfig)
    with pytest.raises(DeviceNotConnectedError):
        leader.get_action()


def test_a_gamepad_that_is_not_there_is_one_clear_error(pad, gamepad_leader, tmp_path, monkeypatch):
    pad.is_there = False
    with pytest.raises(NoGamepad, match="has been disconnected"):
        gamepad_leader.get_action()
    another = BimanualGamepad(BimanualGamepadConfig(calibration_dir=tmp_path))
    with pytest.raises(NoGamepad, match="bimanual_keyboard needs a terminal only"):
        another.connect()
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(NoGamepad, match=r"pip install 'lerobot_robot_bimanual\[gamepad\]'"):
        another.connect()
    assert not another.is_connected


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


@pytest.mark.parametrize(
    ("config", "option", "value"),
    [
        (BimanualKeyboardConfig, "step_m", 1.0),
        (BimanualKeyboardConfig, "step_deg", float("nan")),
        (BimanualGamepadConfig, "speed_m_s", 2.0),
        (BimanualGamepadConfig, "speed_deg_s", float("nan")),
        (BimanualGamepadConfig, "dead_zone", 1.0),
    ],
)
def test_what_no_servo_should_be_sent_is_refused(config, option, value):
    with pytest.raises(InvalidChoice, match=option):
        config(**{option: value})
