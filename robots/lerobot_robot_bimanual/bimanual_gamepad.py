"""The teleoperator `bimanual_gamepad`: a gamepad moves a pair of leader arms, one stick per hand."""

from __future__ import annotations

import logging
import sys

import numpy as np

from lerobot_bimanual.arms import ARMS, Arm
from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_robot_bimanual.config_bimanual_gamepad import BimanualGamepadConfig
from lerobot_robot_bimanual.gamepad import Gamepad, GamepadState, HalfState
from lerobot_robot_bimanual.leader import Leader

logger = logging.getLogger(__name__)

AT_REST = GamepadState(dict.fromkeys(ARMS, HalfState()))
HELP = """\
the left half moves the left hand, the right half the right one
stick              up, down (x, towards the right arm's base and back)   left, right (y)
shoulder + stick   up, down (z)   left, right (turn about z)
trigger + stick    up, down (turn about y)   left, right (turn about x)
stick pressed in   gripper (opens, closes)
start              both hands home: the next episode begins"""


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
        self._before = AT_REST
        self._stuck: set[Arm] = set()

    def _open(self) -> Gamepad:
        gamepad = Gamepad()
        logger.info("%s:\n%s", gamepad.name, HELP)
        return gamepad

    def _forget(self, device: Gamepad) -> None:
        self._before = device.read()

    def _follow(self, device: Gamepad) -> None:
        before, self._before = self._before, device.read()
        if self._before.start and not before.start:
            self._arms.go_home()
            return
        for arm in ARMS:
            half = self._before.halves[arm]
            if half.stick and not before.halves[arm].stick:
                self._arms.switch_gripper(arm)
            self._move(arm, half)

    def _move(self, arm: Arm, half: HalfState) -> None:
        up, left = self._beyond_dead_zone(half.up), self._beyond_dead_zone(-half.right)
        offset, turn = np.zeros(3), np.zeros(3)
        if half.shoulder:
            offset[2], turn[2] = up, left
        elif half.trigger:
            turn[1], turn[0] = up, -left
        else:
            offset[:2] = up, left
        if not (offset.any() or turn.any()):
            return
        step_m, step_rad = (
            self.config.speed_m_s / CONTROL_HZ,
            np.deg2rad(self.config.speed_deg_s) / CONTROL_HZ,
        )
        if self._arms.move(arm, offset * step_m, turn * step_rad):
            self._stuck.discard(arm)
        elif arm not in self._stuck:  # printed once, not twenty times a second
            self._stuck.add(arm)
            sys.stderr.write(f"\a{arm} arm cannot go there\n")

    def _beyond_dead_zone(self, value: float) -> float:
        """Rescale a stick's deflection: 0 within the dead zone, and continuous from there to -1 or 1."""
        beyond = max(0.0, abs(value) - self.config.dead_zone) / (1 - self.config.dead_zone)
        return float(np.copysign(min(beyond, 1.0), value))
