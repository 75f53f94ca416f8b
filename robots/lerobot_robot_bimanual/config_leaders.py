"""LeRobot's `--teleop.type=bimanual_keyboard` and `--teleop.type=bimanual_gamepad`."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig

from lerobot_bimanual.errors import InvalidChoice
from lerobot_bimanual.joint_action import CONTROL_HZ

MAX_STEP_M, MAX_STEP_DEG = 0.05, 15.0
"""Largest movement and turn of a hand from one action to the next: how far a servo may be sent at once."""


@TeleoperatorConfig.register_subclass("bimanual_keyboard")
@dataclass(kw_only=True)
class BimanualKeyboardConfig(TeleoperatorConfig):
    """A keyboard that moves both hands in steps.

    Raises:
        InvalidChoice: a step is not positive, or larger than a servo should be sent at once.
    """

    # How far one stroke moves a hand, in metres.
    step_m: float = 0.01
    # By how much one stroke turns a hand, in degrees.
    step_deg: float = 5.0

    def __post_init__(self) -> None:
        """Check both steps."""
        _check_positive("step_m", self.step_m, MAX_STEP_M)
        _check_positive("step_deg", self.step_deg, MAX_STEP_DEG)


@TeleoperatorConfig.register_subclass("bimanual_gamepad")
@dataclass(kw_only=True)
class BimanualGamepadConfig(TeleoperatorConfig):
    """A gamepad that moves both hands at once.

    Raises:
        InvalidChoice: a speed is not positive, or faster than a servo should be sent; a dead zone that is none.
    """

    # How fast a stick at its end moves a hand, in metres per second at 20 frames per second.
    speed_m_s: float = 0.2
    # How fast a stick at its end turns a hand, in degrees per second at 20 frames per second.
    speed_deg_s: float = 60.0
    # Share of a stick's way around its middle that counts as the middle.
    dead_zone: float = 0.15

    def __post_init__(self) -> None:
        """Check all three."""
        _check_positive("speed_m_s", self.speed_m_s, MAX_STEP_M * CONTROL_HZ)
        _check_positive("speed_deg_s", self.speed_deg_s, MAX_STEP_DEG * CONTROL_HZ)
        if not 0 <= self.dead_zone < 1:
            raise InvalidChoice("dead_zone", self.dead_zone, "a number from 0, below 1")


def _check_positive(name: str, value: float, largest: float) -> None:
    if not 0 < value <= largest:
        raise InvalidChoice(name, value, f"a number above 0, up to {largest:g}")
