"""The teleoperator `bimanual_keyboard`: the keys of a terminal move a pair of leader arms in steps."""

from __future__ import annotations

import logging
import sys

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_robot_bimanual.config_bimanual_keyboard import BimanualKeyboardConfig
from lerobot_robot_bimanual.leader import Leader
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
HELP = """\
hand      1 left   2 right   3 both
move      w s (x, towards the right arm's base and back)   a d (y, left and right)   e c (up and down)
turn      j l (about x)   i k (about y)   u o (about z)
gripper   f (opens, closes)
next      h (both hands home: the next episode begins)"""


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
        logger.info("keys:\n%s", HELP)
        return keys

    def _forget(self, device: TerminalKeys) -> None:
        device.struck()

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
                if not self._arms.move(arm, offset_m, turn_rad):
                    sys.stderr.write(f"\a{arm} arm cannot go there\n")
