"""Both hands are moved at once by the sticks of a gamepad."""

import sys
from types import ModuleType

import numpy as np
import pytest
from lerobot.common.control_utils import teleop_supports_feedback
from lerobot.teleoperators.utils import make_teleoperator_from_config
from lerobot.utils.errors import DeviceNotConnectedError

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.errors import InvalidChoice
from lerobot_env_bimanual.robots.panda_pair import PANDA_PAIR
from lerobot_robot_bimanual.bimanual_gamepad import BimanualGamepad
from lerobot_robot_bimanual.config_bimanual_gamepad import BimanualGamepadConfig
from lerobot_robot_bimanual.gamepad import FULL, NoGamepad

SIDES = {Arm.LEFT: "LEFT", Arm.RIGHT: "RIGHT"}
CONTROLS = {
    "AXIS": ("LEFTX", "LEFTY", "RIGHTX", "RIGHTY", "TRIGGERLEFT", "TRIGGERRIGHT"),
    "BUTTON": ("START", "LEFTSTICK", "RIGHTSTICK", "LEFTSHOULDER", "RIGHTSHOULDER"),
}


class Pad:
    """A gamepad as SDL shows it: values by the numbers of axes and buttons.

    Attributes:
        held: values by name; what is missing is at rest.
        is_there: whether it is connected.
    """

    name = "pad of a test"

    def __init__(self):
        self.held: dict[str, float] = {}
        self.is_there = True
        self.is_open = True

    def get_axis(self, axis: int) -> int:
        return int(self.held.get(CONTROLS["AXIS"][axis], 0.0) * FULL)

    def get_button(self, button: int) -> bool:
        return bool(self.held.get(CONTROLS["BUTTON"][button], False))

    def attached(self) -> bool:
        return self.is_there

    def quit(self) -> None:
        self.is_open = False


@pytest.fixture
def pad(monkeypatch) -> Pad:
    """The second device, after one that is no gamepad, in a pygame of ours."""
    pad, pygame, sdl = Pad(), ModuleType("pygame"), ModuleType("pygame._sdl2.controller")
    for kind, names in CONTROLS.items():
        for number, name in enumerate(names):
            setattr(pygame, f"CONTROLLER_{kind}_{name}", number)
    nothing = dict.fromkeys(("init", "quit", "update"), lambda: None)
    vars(sdl).update(
        nothing,
        get_count=lambda: 2 * pad.is_there,
        is_controller=lambda index: index == 1,
        Controller=lambda index: {1: pad}[index],
    )
    for module in (pygame, ModuleType("pygame._sdl2"), sdl):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return pad


@pytest.fixture
def leader(pad, tmp_path) -> BimanualGamepad:
    """Connected, its hands 20 cm below home, where they have room on all sides."""
    leader = BimanualGamepad(BimanualGamepadConfig(calibration_dir=tmp_path))
    leader.connect()
    hold(leader, pad, 20, LEFTSHOULDER=1, LEFTY=1.0, RIGHTSHOULDER=1, RIGHTY=1.0)
    return leader


def hold(leader: BimanualGamepad, pad: Pad, ticks: int = 1, **held: float) -> dict:
    """The hands' poses after holding the pad for some ticks and letting it go."""
    pad.held = dict(held)
    for _ in range(ticks):
        leader.get_action()
    pad.held = {}
    return poses(leader)


def poses(leader: BimanualGamepad) -> dict:
    joints = np.array([*leader.get_action().values()]).reshape(2, 8)[:, :7]
    return {arm: PANDA_PAIR.kinematics[arm].pose(joints[arm.ordinal]) for arm in ARMS}


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
def test_a_stick_moves_and_turns_its_own_hand(leader, pad, arm, modifier, axis, value, offset, turn):
    before, side = poses(leader), SIDES[arm]
    held = {f"{side}{axis}": value}
    if modifier:
        held[modifier.format(side=side)] = 1.0
    after = hold(leader, pad, 3, **held)
    step_m, turned_rad = np.array(offset) * 0.2 * 3 / CONTROL_HZ, np.deg2rad(60) * 3 / CONTROL_HZ
    assert np.allclose(after[arm].position - before[arm].position, step_m, atol=1e-4)
    assert before[arm].distance_to(after[arm])[1] == pytest.approx(turned_rad * any(turn), abs=1e-4)
    if any(turn):
        turned = after[arm].rotation @ before[arm].rotation.T
        assert np.allclose(turned @ turn, turn, atol=1e-4)
        # Seen along the axis, what stands across it has gone round to the left.
        across = np.roll(turn, 1)
        assert np.cross(across, turned @ across) @ turn > 0
    other = arm.other
    assert max(before[other].distance_to(after[other])) < 1e-6


def test_a_stick_that_is_let_go_moves_nothing_and_speed_begins_at_nothing(leader, pad):
    before = leader.get_action()
    hold(leader, pad, LEFTX=0.14, RIGHTY=-0.14)
    assert leader.get_action() == before
    start = poses(leader)
    slow = hold(leader, pad, LEFTY=-0.2)
    assert 0 < slow[Arm.LEFT].position[0] - start[Arm.LEFT].position[0] < 0.001


def test_a_pressed_stick_switches_its_gripper_once_and_start_sends_both_hands_home(leader, pad):
    for right_opening in (0.0, 1.0, 0.0):
        hold(leader, pad, 5, RIGHTSTICK=1)
        action = leader.get_action()
        assert (action["left_gripper.pos"], action["right_gripper.pos"]) == (1.0, right_opening)
    hold(leader, pad, START=1, LEFTY=-1.0)
    assert np.allclose([*leader.get_action().values()], [*PANDA_PAIR.home_joints, 1.0] * 2)


def test_an_arm_goes_as_far_as_it_reaches_and_says_so_once(leader, pad, capsys):
    hold(leader, pad, 200, LEFTX=-1.0)
    assert capsys.readouterr().err.count("left arm cannot go there") == 1
    hold(leader, pad, 5, LEFTX=1.0)
    hold(leader, pad, 50, LEFTX=-1.0)
    assert capsys.readouterr().err.count("left arm cannot go there") == 1


def test_the_leader_arms_go_where_the_robot_is_and_what_is_held_meanwhile_counts_once(leader, pad):
    assert teleop_supports_feedback(leader)
    elsewhere = leader.get_action()
    hold(leader, pad, 10, LEFTY=-1.0)
    pad.held = {"LEFTSTICK": 1}
    leader.send_feedback(elsewhere)
    assert leader.get_action() == elsewhere


def test_lerobot_makes_it_from_its_config(pad, tmp_path):
    leader = make_teleoperator_from_config(BimanualGamepadConfig(calibration_dir=tmp_path))
    assert tuple(leader.action_features) == schema.JOINT_NAMES
    leader.connect()
    leader.disconnect()
    assert not pad.is_open
    with pytest.raises(DeviceNotConnectedError):
        leader.get_action()


def test_a_gamepad_that_is_not_there_is_one_clear_error(pad, leader, tmp_path, monkeypatch):
    pad.is_there = False
    with pytest.raises(NoGamepad, match="has been disconnected"):
        leader.get_action()
    another = BimanualGamepad(BimanualGamepadConfig(calibration_dir=tmp_path))
    with pytest.raises(NoGamepad, match="bimanual_keyboard needs a terminal only"):
        another.connect()
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(NoGamepad, match=r"pip install 'lerobot_robot_bimanual\[gamepad\]'"):
        another.connect()
    assert not another.is_connected


@pytest.mark.parametrize(
    "option",
    [{"speed_m_s": 2.0}, {"speed_deg_s": float("nan")}, {"dead_zone": 1.0}],
)
def test_a_speed_that_no_servo_should_be_sent_is_refused(option):
    (name,) = option
    with pytest.raises(InvalidChoice, match=name):
        BimanualGamepadConfig(**option)
