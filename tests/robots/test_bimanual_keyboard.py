"""Both hands are moved by keys."""

import sys
from pathlib import Path

import numpy as np
import pytest
from lerobot.common.control_utils import teleop_supports_feedback
from lerobot.utils.errors import DeviceNotConnectedError
from lerobot.utils.keyboard_input import init_keyboard_listener

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_robot_bimanual import bimanual_keyboard
from lerobot_robot_bimanual.bimanual_keyboard import BimanualKeyboard
from lerobot_robot_bimanual.config_bimanual_keyboard import BimanualKeyboardConfig
from lerobot_robot_bimanual.terminal_keys import WRITTEN, NoTerminal, TerminalKeys

DOWN = "3" + "c" * 20
"""At home the arms are nearly stretched; further down hands have room on all sides."""


class Script:
    """Keys that were written down beforehand, in place of a terminal."""

    def __init__(self, keys: str):
        self.keys = [*keys]

    def struck(self) -> list[str]:
        keys, self.keys = self.keys, []
        return keys

    def stop(self) -> None:
        pass


@pytest.fixture
def typed(monkeypatch, tmp_path):
    """The hands' poses, and the action, after some keys."""

    def after(keys: str, **options):
        monkeypatch.setattr(bimanual_keyboard, "TerminalKeys", lambda names: Script(keys))
        teleoperator = BimanualKeyboard(BimanualKeyboardConfig(calibration_dir=tmp_path, **options))
        teleoperator.connect()
        action = teleoperator.get_action()
        joints = np.array([*action.values()]).reshape(2, 8)[:, :7]
        poses = {arm: PANDA_PAIR.kinematics[arm].pose(joints[arm.ordinal]) for arm in ARMS}
        teleoperator.disconnect()
        return poses, action

    return after


@pytest.mark.parametrize("key", bimanual_keyboard.MOVES)
def test_a_key_moves_the_chosen_hands_by_a_step_along_an_axis(typed, key):
    before, _ = typed(DOWN, step_m=0.02)
    for choice, hands in bimanual_keyboard.HANDS.items():
        poses, action = typed(DOWN + choice + key, step_m=0.02)
        assert tuple(action) == schema.JOINT_NAMES
        for arm in ARMS:
            step_m = poses[arm].position - before[arm].position
            expected = 0.02 * np.array(bimanual_keyboard.MOVES[key]) * (arm in hands)
            assert np.allclose(step_m, expected, atol=1e-5)
            assert before[arm].distance_to(poses[arm])[1] < 1e-5


@pytest.mark.parametrize("key", bimanual_keyboard.TURNS)
def test_a_key_turns_the_chosen_hand_where_it_is(typed, key):
    before, _ = typed(DOWN)
    poses, _ = typed(f"{DOWN}2{key}", step_deg=10.0)
    moved_m, turned_rad = before[Arm.RIGHT].distance_to(poses[Arm.RIGHT])
    assert moved_m < 1e-5
    assert np.rad2deg(turned_rad) == pytest.approx(10.0, abs=1e-3)
    axis = np.array(bimanual_keyboard.TURNS[key])
    assert np.allclose(poses[Arm.RIGHT].rotation @ before[Arm.RIGHT].rotation.T @ axis, axis, atol=1e-5)
    assert max(before[Arm.LEFT].distance_to(poses[Arm.LEFT])) < 1e-5


def test_grippers_open_and_close_and_home_is_where_both_arms_began(typed):
    openings = [typed(keys)[1]["left_gripper.pos"] for keys in ("", "f", "ff")]
    assert openings == [1.0, 0.0, 1.0]
    assert typed("2f")[1]["left_gripper.pos"] == 1.0
    assert typed("3f")[1]["right_gripper.pos"] == 0.0
    assert typed("3wwwaaaf2iih")[1] == typed("")[1]


def test_an_arm_goes_as_far_as_it_reaches_and_no_joint_jumps(typed, capsys):
    at_first, _ = typed(DOWN)
    at_last, before = typed(DOWN + "1" + "a" * 100)
    _, after = typed(DOWN + "1" + "a" * 101)
    assert before == after
    assert "left arm cannot go there" in capsys.readouterr().err
    assert at_last[Arm.LEFT].position[1] - at_first[Arm.LEFT].position[1] > 0.4


def test_every_key_is_in_the_help_and_not_one_of_lerobots():
    assert not set(bimanual_keyboard.KEYS) & {"n", "r", "q", *WRITTEN}
    assert len(bimanual_keyboard.KEYS) == len(set(bimanual_keyboard.KEYS))
    assert set(bimanual_keyboard.KEYS) <= set(bimanual_keyboard.HELP.replace("(", " ").split())


def test_the_leader_arms_go_where_the_robot_is(typed, tmp_path):
    teleoperator = BimanualKeyboard(BimanualKeyboardConfig(calibration_dir=tmp_path))
    assert teleop_supports_feedback(teleoperator)
    _, elsewhere = typed("3ccww2dd")
    teleoperator.connect()
    teleoperator.send_feedback(elsewhere)
    assert teleoperator.get_action() == elsewhere
    teleoperator.send_feedback({"left_joint1.pos": 100.0})  # of a policy that has gone astray
    limited = teleoperator.get_action()
    assert limited == elsewhere | {"left_joint1.pos": limited["left_joint1.pos"]}
    assert limited["left_joint1.pos"] < PANDA_PAIR.joint_upper[0]


def test_keys_are_shared_with_lerobots_controls(keyboard, soon):
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


def test_without_a_terminal_there_is_one_clear_error(monkeypatch, tmp_path):
    with Path("/dev/null").open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        teleoperator = BimanualKeyboard(BimanualKeyboardConfig(calibration_dir=tmp_path))
        with pytest.raises(NoTerminal, match="without a pipe"):
            teleoperator.connect()
    with pytest.raises(DeviceNotConnectedError):
        teleoperator.get_action()


@pytest.mark.parametrize("option", [{"step_m": 1.0}, {"step_deg": float("nan")}])
def test_a_step_that_no_servo_should_be_sent_is_refused(option):
    with pytest.raises(InvalidChoice, match="step_"):
        BimanualKeyboardConfig(**option)
