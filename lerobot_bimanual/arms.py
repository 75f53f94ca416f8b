"""The two arms, their order, and the joint action: what one control tick commands, per arm seven targets and the gripper.

Every array, feature name and tuple of this project lists the left arm before the right arm, as LeRobot and
ALOHA do. PerAct2's reference code lists the right arm first: convert at the border when comparing with it.

As a vector (16,) the joint action is what `BimanualEnv.step` takes and the column `action` stores: left joints in rad,
left gripper from 0 closed to 1 open, then the same of the right arm.
"""

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

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

CONTROL_HZ = 20
"""Control ticks per second; one tick is one dataset frame (RLBench records one observation per 0.05 s)."""

ARM_ACTION_DIM = JOINTS_PER_ARM + 1
JOINT_ACTION_DIM = len(ARMS) * ARM_ACTION_DIM
GRIPPERS = slice(JOINTS_PER_ARM, None, ARM_ACTION_DIM)
"""The two gripper entries of a vector."""


def by_arm[T: np.generic](actions: NDArray[T]) -> NDArray[T]:
    """The same numbers with an axis for the arms, (..., 16) -> (..., 2, 8); a view of contiguous arrays."""
    return actions.reshape(*actions.shape[:-1], len(ARMS), ARM_ACTION_DIM)
