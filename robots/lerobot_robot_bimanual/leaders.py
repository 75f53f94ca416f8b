"""The teleoperators: a pair of virtual leader arms that the keys of a terminal or a gamepad's sticks move."""

from __future__ import annotations

import abc
import logging
import sys
from typing import Any, Protocol

import numpy as np
from lerobot.teleoperators.config import TeleoperatorConfig
from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.joint_action import CONTROL_HZ
from lerobot_robot_bimanual.config_leaders import BimanualGamepadConfig, BimanualKeyboardConfig
from lerobot_robot_bimanual.gamepad import Gamepad, HalfState
from lerobot_robot_bimanual.leader_arms import LeaderArms
from lerobot_robot_bimanual.terminal_keys import TerminalKeys

logger = logging.getLogger(__name__)

HANDS: dict[str, tuple[Arm, ...]] = {"1": (Arm.LEFT,), "2": (Arm.RIGHT,), "3": ARMS}
MOVES = {
    **{"w": (1, 0, 0), "s": (-1, 0, 0)},
    **{"a": (0, 1, 0), "d": (0, -1, 0)},
    **{"e": (0, 0, 1), "c": (0, 0, -1)},
}
TURNS = {
    **{"l": (1, 0, 0), "j": (-1, 0, 0)},
    **{"k": (0, 1, 0), "i": (0, -1, 0)},
    **{"u": (0, 0, 1), "o": (0, 0, -1)},
}
GRIPPER, HOME = "f", "h"
KEYS = (*HANDS, *MOVES, *TURNS, GRIPPER, HOME)
KEYBOARD_HELP = """\
hand      1 left   2 right   3 both
move      w s (x, towards the right arm's base and back)   a d (y, left and right)   e c (up and down)
turn      j l (about x)   i k (about y)   u o (about z)
gripper   f (opens, closes)
next      h (both hands home: the next episode begins)"""
GAMEPAD_HELP = """\
the left half moves the left hand, the right half the right one
stick              up, down (x, towards the right arm's base and back)   left, right (y)
shoulder + stick   up, down (z)   left, right (turn about z)
trigger + stick    up, down (turn about y)   left, right (turn about x)
stick pressed in   gripper (opens, closes)
start              both hands home: the next episode begins"""


class Device(Protocol):
    """An input device of an operator."""

    def stop(self) -> None:
        """Release the device; it may be opened again."""
        ...


class Leader[D: Device](Teleoperator):
    """A pair of virtual leader arms, which an input device moves.

    A teleoperator of LeRobot does not see the robot, so this one has arms of its own, like leader arms of real robots:
    they begin at home, and their joints are the action. Where LeRobot hands over from a policy to a person
    (`lerobot-rollout --strategy.type=dagger`), it moves these arms to where the robot is.
    """

    def __init__(self, config: TeleoperatorConfig):
        super().__init__(config)
        self._arms = LeaderArms()
        self._stuck: set[Arm] = set()
        self._device: D | None = None

    @abc.abstractmethod
    def _open(self) -> D:
        """Open the device."""

    @abc.abstractmethod
    def _follow(self, device: D) -> None:
        """Move the arms by the device's input since the last call."""

    def _move(self, arm: Arm, offset_m: NDArray[np.floating], turn_rad: NDArray[np.floating]) -> None:
        """Move and turn a hand in the world's axes; where its arm cannot follow, tell the operator once."""
        if self._arms.move(arm, offset_m, turn_rad):
            self._stuck.discard(arm)
        elif arm not in self._stuck:
            self._stuck.add(arm)
            sys.stderr.write(f"\a{arm} arm cannot go there\n")

    @property
    def action_features(self) -> dict[str, Any]:
        """The sixteen numbers of a joint action, by name."""
        return dict.fromkeys(schema.JOINT_NAMES, float)

    @property
    def feedback_features(self) -> dict[str, Any]:
        """Joints of the robot, by the same names."""
        return self.action_features

    @property
    def is_connected(self) -> bool:
        """Whether the device is being read."""
        return self._device is not None

    @property
    def is_calibrated(self) -> bool:
        """Virtual arms always are."""
        return True

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do."""

    def enable_torque(self) -> None:
        """Nothing to do; its presence tells LeRobot that these arms can be moved to where the robot is."""

    def disable_torque(self) -> None:
        """Nothing to do."""

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Open the device.

        Raises:
            BimanualError: the device is not there.
            DeviceAlreadyConnectedError: it is open already.
        """
        self._device = self._open()

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """Joints of the leader arms after the device's input since the last call.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._device is not None
        self._follow(self._device)
        return dict(zip(schema.JOINT_NAMES, self._arms.joint_action.tolist(), strict=True))

    @check_if_not_connected
    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Move the leader arms to where the robot is, and discard how the device has moved them since the last action.

        Args:
            feedback: joint targets and openings by name, of which some may be missing.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._device is not None
        present = dict(zip(schema.JOINT_NAMES, self._arms.joint_action.tolist(), strict=True))
        self._follow(self._device)
        self._arms.go_to([feedback.get(name, value) for name, value in present.items()])

    @check_if_not_connected
    def disconnect(self) -> None:
        """Release the device.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._device is not None
        self._device.stop()
        self._device = None


class BimanualKeyboard(Leader[TerminalKeys]):
    """A pair of leader arms, moved hand by hand with the keys of a terminal.

    A key is one step of the chosen hand; keeping it down repeats the step. It works through ssh. Where standard input is no
    terminal, `connect` raises `NoTerminal`.
    """

    config_class = BimanualKeyboardConfig
    name = "bimanual_keyboard"

    def __init__(self, config: BimanualKeyboardConfig):
        super().__init__(config)
        self.config = config
        self._hands: tuple[Arm, ...] = (Arm.LEFT,)

    def _open(self) -> TerminalKeys:
        keys = TerminalKeys(KEYS)
        logger.info("keys:\n%s", KEYBOARD_HELP)
        return keys

    def _follow(self, device: TerminalKeys) -> None:
        for key in device.struck():
            self._strike(key)

    def _strike(self, key: str) -> None:
        if key in HANDS:
            self._hands = HANDS[key]
        elif key == HOME:
            self._arms.go_home()
        elif key == GRIPPER:
            for arm in self._hands:
                self._arms.switch_gripper(arm)
        else:
            offset_m = np.array(MOVES.get(key, (0, 0, 0))) * self.config.step_m
            turn_rad = np.array(TURNS.get(key, (0, 0, 0))) * np.deg2rad(self.config.step_deg)
            for arm in self._hands:
                self._move(arm, offset_m, turn_rad)


class BimanualGamepad(Leader[Gamepad]):
    """A pair of leader arms, moved by the two sticks of a gamepad at the same time.

    Every call of `get_action` is one tick of 50 ms, in which a stick at its end moves its hand by a twentieth of the speed.
    Without pygame or a gamepad `connect` raises `NoGamepad`.
    """

    config_class = BimanualGamepadConfig
    name = "bimanual_gamepad"

    def __init__(self, config: BimanualGamepadConfig):
        super().__init__(config)
        self.config = config
        self._halves, self._start = dict.fromkeys(ARMS, HalfState()), False

    def _open(self) -> Gamepad:
        gamepad = Gamepad()
        logger.info("%s:\n%s", gamepad.name, GAMEPAD_HELP)
        return gamepad

    def _follow(self, device: Gamepad) -> None:
        halves, start = self._halves, self._start
        self._halves, self._start = device.read()
        if self._start and not start:
            self._arms.go_home()
            return
        for arm, half in self._halves.items():
            if half.stick and not halves[arm].stick:
                self._arms.switch_gripper(arm)
            self._move_by_half(arm, half)

    def _move_by_half(self, arm: Arm, half: HalfState) -> None:
        up, left = self._beyond_dead_zone(half.up), self._beyond_dead_zone(-half.right)
        offset, turn = np.zeros(3), np.zeros(3)
        if half.shoulder:
            offset[2], turn[2] = up, left
        elif half.trigger:
            turn[1], turn[0] = up, -left
        else:
            offset[:2] = up, left
        if offset.any() or turn.any():
            step_m = self.config.speed_m_s / CONTROL_HZ
            step_rad = np.deg2rad(self.config.speed_deg_s) / CONTROL_HZ
            self._move(arm, offset * step_m, turn * step_rad)

    def _beyond_dead_zone(self, value: float) -> float:
        """Rescale a stick's deflection: 0 within the dead zone, and continuous from there to -1 or 1."""
        beyond = max(0.0, abs(value) - self.config.dead_zone) / (1 - self.config.dead_zone)
        return float(np.copysign(min(beyond, 1.0), value))
