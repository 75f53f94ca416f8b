"""The two arms and their order.

Every array, feature name and tuple of this project lists the left arm before the right arm, as LeRobot and
ALOHA do. PerAct2's reference code lists the right arm first: convert at the border when comparing with it.
"""

from enum import StrEnum

JOINTS_PER_ARM = 7


class Arm(StrEnum):
    """One of the two arms; the value is the prefix of every name that belongs to it."""

    LEFT = "left"
    RIGHT = "right"

    @property
    def ordinal(self) -> int:
        """Position of this arm in every two-arm array: 0 for left, 1 for right."""
        return 0 if self is Arm.LEFT else 1

    @property
    def other(self) -> "Arm":
        """The opposite arm."""
        return Arm.RIGHT if self is Arm.LEFT else Arm.LEFT


ARMS = (Arm.LEFT, Arm.RIGHT)
