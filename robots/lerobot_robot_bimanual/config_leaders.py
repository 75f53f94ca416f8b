"""LeRobot's `--teleop.type=bimanual_keyboard`."""

from __future__ import annotations

from dataclasses import dataclass

from lerobot.teleoperators.config import TeleoperatorConfig

from lerobot_bimanual.errors import InvalidChoice

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
        for name, largest in (("step_m", MAX_STEP_M), ("step_deg", MAX_STEP_DEG)):
            if not 0 < (value := getattr(self, name)) <= largest:
                raise InvalidChoice(name, value, f"a number above 0, up to {largest:g}")
