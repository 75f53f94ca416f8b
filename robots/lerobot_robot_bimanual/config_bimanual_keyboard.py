"""LeRobot's `--teleop.type=bimanual_keyboard`."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig

from lerobot_bimanual.errors import InvalidChoice
from lerobot_robot_bimanual.step_limits import MAX_STEP_DEG, MAX_STEP_M


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
        for name, largest in (("step_m", MAX_STEP_M), ("step_deg", MAX_STEP_DEG)):
            step = getattr(self, name)
            if not 0 < step <= largest:
                raise InvalidChoice(name, step, f"a number above 0, up to {largest}")
