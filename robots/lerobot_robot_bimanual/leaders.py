"""The teleoperator: a pair of virtual leader arms that the keys of a terminal move."""

from __future__ import annotations

import contextlib
import logging
import os
import pty
import sys
from collections.abc import Collection
from queue import Empty, SimpleQueue
from typing import Any, TextIO

import numpy as np
from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected
from lerobot.utils.keyboard_input import TerminalKeyListener
from numpy.typing import NDArray

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.dataset import schema
from lerobot_bimanual.errors import BimanualError
from lerobot_robot_bimanual.config_leaders import BimanualKeyboardConfig
from lerobot_robot_bimanual.leader_arms import LeaderArms

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

WRITTEN = {"up": "\x1b[A", "down": "\x1b[B", "right": "\x1b[C", "left": "\x1b[D", "esc": "\x1b"} | {
    "enter": "\n",
    "tab": "\t",
    "space": " ",
    "backspace": "\x7f",
}
"""Characters that a terminal sends for the keys that LeRobot names."""


class NoTerminal(BimanualError):
    """Standard input is not a terminal, so there are no keys to read."""

    def __init__(self) -> None:
        super().__init__(
            "bimanual_keyboard reads keys from the terminal, but standard input is not a terminal: start the command "
            "without a pipe or a redirection"
        )


class TerminalKeys:
    """Keys by name, in the order in which they were struck.

    `lerobot-record` reads the terminal as well (next, re-record, quit), and a terminal gives each key only once. So while
    these keys are read, standard input is a pseudo terminal that all other keys are passed to.

    Args:
        names: the keys that are kept.

    Raises:
        NoTerminal: standard input is not a terminal.
    """

    def __init__(self, names: Collection[str]):
        if not sys.stdin.isatty():
            raise NoTerminal
        self._names = names
        self._struck: SimpleQueue[str] = SimpleQueue()
        self._terminal: TextIO = sys.stdin
        self._listener = TerminalKeyListener(self._sort)
        self._listener.start()  # keeps the descriptor of the terminal
        self._others, substitute = pty.openpty()
        os.set_blocking(self._others, False)
        # It stays open: LeRobot's listener still reads it after `stop`.
        sys.stdin = os.fdopen(substitute, closefd=False)

    def struck(self) -> list[str]:
        """The keys since the last call."""
        keys = []
        with contextlib.suppress(Empty):
            while True:
                keys.append(self._struck.get_nowait())
        return keys

    def stop(self) -> None:
        """Give the terminal back."""
        sys.stdin = self._terminal
        self._listener.stop()

    def _sort(self, key: str) -> None:
        if key in self._names:
            self._struck.put(key)
        else:
            with contextlib.suppress(BlockingIOError):  # no listener reads them
                os.write(self._others, WRITTEN.get(key, key).encode())


class BimanualKeyboard(Teleoperator):
    """A pair of virtual leader arms, moved hand by hand with the keys of a terminal.

    A teleoperator of LeRobot does not see the robot, so this one has arms of its own, like leader arms of real robots:
    they begin at home, and their joints are the action. Where LeRobot hands over from a policy to a person
    (`lerobot-rollout --strategy.type=dagger`), it moves these arms to where the robot is.

    A key is one step of the chosen hand; keeping it down repeats the step. It works through ssh. Where standard input is no
    terminal, `connect` raises `NoTerminal`.
    """

    config_class = BimanualKeyboardConfig
    name = "bimanual_keyboard"

    def __init__(self, config: BimanualKeyboardConfig):
        super().__init__(config)
        self.config = config
        self._arms = LeaderArms()
        self._hands: tuple[Arm, ...] = (Arm.LEFT,)
        self._stuck: set[Arm] = set()
        self._keys: TerminalKeys | None = None

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
        """Whether the keys are being read."""
        return self._keys is not None

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
        """Take over the keys of the terminal.

        Raises:
            NoTerminal: there is none.
            DeviceAlreadyConnectedError: they are being read already.
        """
        self._keys = TerminalKeys(KEYS)
        logger.info("keys:\n%s", KEYBOARD_HELP)

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """Joints of the leader arms after the keys since the last call.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._keys is not None
        self._follow(self._keys)
        return dict(zip(schema.JOINT_NAMES, self._arms.joint_action.tolist(), strict=True))

    @check_if_not_connected
    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Move the leader arms to where the robot is, and discard the keys since the last action.

        Args:
            feedback: joint targets and openings by name, of which some may be missing.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._keys is not None
        present = dict(zip(schema.JOINT_NAMES, self._arms.joint_action.tolist(), strict=True))
        self._follow(self._keys)
        self._arms.go_to([feedback.get(name, value) for name, value in present.items()])

    @check_if_not_connected
    def disconnect(self) -> None:
        """Give the terminal back.

        Raises:
            DeviceNotConnectedError: before `connect`.
        """
        assert self._keys is not None
        self._keys.stop()
        self._keys = None

    def _follow(self, keys: TerminalKeys) -> None:
        """Move the arms by the keys since the last call."""
        for key in keys.struck():
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

    def _move(self, arm: Arm, offset_m: NDArray[np.floating], turn_rad: NDArray[np.floating]) -> None:
        """Move and turn a hand in the world's axes; where its arm cannot follow, tell the operator once."""
        if self._arms.move(arm, offset_m, turn_rad):
            self._stuck.discard(arm)
        elif arm not in self._stuck:
            self._stuck.add(arm)
            sys.stderr.write(f"\a{arm} arm cannot go there\n")
