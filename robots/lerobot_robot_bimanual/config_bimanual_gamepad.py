"""LeRobot's `--teleop.type=bimanual_gamepad`."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig

from lerobot_bimanual.episode import CONTROL_HZ
from lerobot_bimanual.errors import InvalidChoice
from lerobot_robot_bimanual.step_limits import MAX_STEP_DEG, MAX_STEP_M


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
        for name, largest in (
            ("speed_m_s", MAX_STEP_M * CONTROL_HZ),
            ("speed_deg_s", MAX_STEP_DEG * CONTROL_HZ),
        ):
            speed = getattr(self, name)
            if not 0 < speed <= largest:
                raise InvalidChoice(name, speed, f"a number above 0, up to {largest:g}")
        if not 0 <= self.dead_zone < 1:
            raise InvalidChoice("dead_zone", self.dead_zone, "a number from 0, below 1")
